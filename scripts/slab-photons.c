// Light through a slab, photon by photon: what scripts/check-captures makes its pictures of. Shares no code with
// lumislice.
//
//   cc -O3 -o slab-photons slab-photons.c -lm
//   slab-photons SCATTERING ABSORPTION G THICKNESS INDEX PHOTONS SEED
//
// Coefficients per mm, Henyey and Greenstein's phase function, faces that reflect by Fresnel. Photons come from outside
// at one point, from all sides as of a matt light, and what a face mirrors at once is left out. Prints the totals of
// reflection and transmission, then rings: from, to (mm), reflection and its standard error per mm², transmission and
// its own.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "photons.h"

enum { RINGS = 260 };
static const double FIRST_MM = 0.002, LAST_MM = 80;

int main(int count, char **word) {
    if (count != 8) return 2;
    double scattering = atof(word[1]), absorption = atof(word[2]), g = atof(word[3]), thickness = atof(word[4]);
    double index = atof(word[5]), extinction = scattering + absorption, step = log(LAST_MM / FIRST_MM) / RINGS;
    long photons = atol(word[6]);
    seed(strtoull(word[7], 0, 10));
    static double sum[2][RINGS + 1], squares[2][RINGS + 1], total[2];
    for (long photon = 0; photon < photons; photon++) {
        double x = 0, y = 0, z = 0, weight = 1;
        double sine = sqrt(draw()), angle = 2 * M_PI * draw();
        double ux = sine * cos(angle), uy = sine * sin(angle), uz = sqrt(1 - sine * sine);
        if (draw() < mirrored(uz, 1, index)) continue;
        ux /= index, uy /= index, uz = sqrt(1 - ux * ux - uy * uy);
        for (int inside = 1; inside;) {
            double length = -log(draw()) / extinction;
            for (;;) {
                double to_face = uz > 0 ? (thickness - z) / uz : uz < 0 ? -z / uz : 1e30;
                if (length < to_face) break;
                x += ux * to_face, y += uy * to_face, z = uz > 0 ? thickness : 0, length -= to_face;
                if (draw() >= mirrored(fabs(uz), index, 1)) {
                    int side = uz > 0;
                    double r = sqrt(x * x + y * y);
                    int ring = r < FIRST_MM ? 0 : (int)(log(r / FIRST_MM) / step) + 1;
                    if (ring <= RINGS) sum[side][ring] += weight, squares[side][ring] += weight * weight;
                    total[side] += weight, inside = 0;
                    break;
                }
                uz = -uz;
            }
            if (!inside) break;
            x += ux * length, y += uy * length, z += uz * length, weight *= scattering / extinction;
            if (weight < 0.05 && draw() < 0.5) break;
            if (weight < 0.05) weight *= 2;
            double q = (1 - g * g) / (1 - g + 2 * g * draw());
            double turn = fabs(g) < 1e-6 ? 2 * draw() - 1 : (1 + g * g - q * q) / (2 * g);
            double aside = sqrt(fmax(0, 1 - turn * turn)), around = 2 * M_PI * draw();
            double c = cos(around), s = sin(around), flat = sqrt(fmax(0, 1 - uz * uz));
            double was[3] = {ux, uy, uz};
            if (flat < 1e-6) {
                ux = aside * c, uy = aside * s, uz = was[2] > 0 ? turn : -turn;
            } else {
                ux = aside * (was[0] * was[2] * c - was[1] * s) / flat + was[0] * turn;
                uy = aside * (was[1] * was[2] * c + was[0] * s) / flat + was[1] * turn;
                uz = -aside * c * flat + was[2] * turn;
            }
        }
    }
    printf("%g %g\n", total[0] / photons, total[1] / photons);
    for (int ring = 0; ring <= RINGS; ring++) {
        double from = ring ? FIRST_MM * exp(step * (ring - 1)) : 0, to = FIRST_MM * exp(step * ring);
        double area = M_PI * (to * to - from * from) * photons;
        printf("%.9g %.9g", from, to);
        for (int i = 0; i < 2; i++) printf(" %.9g %.9g", sum[i][ring] / area, sqrt(squares[i][ring]) / area);
        printf("\n");
    }
}
