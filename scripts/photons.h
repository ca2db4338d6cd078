// What the photon programs beside it draw from and mirror by.
#include <math.h>
#include <stdint.h>

// xoshiro256++, seeded by splitmix64 (Blackman and Vigna).
static uint64_t state[4];
static uint64_t left(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }
static double draw(void) {
    uint64_t result = left(state[0] + state[3], 23) + state[0], t = state[1] << 17;
    state[2] ^= state[0], state[3] ^= state[1], state[1] ^= state[2], state[0] ^= state[3], state[2] ^= t;
    state[3] = left(state[3], 45);
    return ((result >> 11) + 0.5) / 9007199254740992.0;
}
static void seed(uint64_t z) {
    for (int i = 0; i < 4; i++) {
        uint64_t y = z += 0x9e3779b97f4a7c15ULL;
        y = (y ^ (y >> 30)) * 0xbf58476d1ce4e5b9ULL, y = (y ^ (y >> 27)) * 0x94d049bb133111ebULL;
        state[i] = y ^ (y >> 31);
    }
}

// Fresnel's reflectance of light that is not polarised, at a cosine from one index of refraction to another.
static double mirrored(double cosine, double from, double to) {
    double sine = from / to * sqrt(fmax(0, 1 - cosine * cosine));
    if (from == to || sine >= 1) return from == to ? 0 : 1;
    double other = sqrt(1 - sine * sine);
    double s = (from * cosine - to * other) / (from * cosine + to * other);
    double p = (from * other - to * cosine) / (from * other + to * cosine);
    return 0.5 * (s * s + p * p);
}
