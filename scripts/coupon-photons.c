// Light through a printed coupon, photon by photon: what scripts/check-coupon makes its photographs of. Shares no code
// with lumislice.
//
//   cc -O3 -o coupon-photons coupon-photons.c -lm
//   coupon-photons PHOTONS SEED < COUPON
//
// Standard input, numbers apart by blanks: index of refraction; resins, and scattering, absorption (per mm) and g of
// each; stacks, and for each its layers, and of every layer resin and mm; columns and rows of squares, their side in
// mm, and the stack of every square row by row; fields, and low x, low y, high x, high y of each in mm. Depth counts
// from the top; below and beside the squares light is lost.
//
// Prints for every field the share of light that comes back of a beam that falls evenly on it straight from above, with
// its standard error: by reciprocity what a camera above sees there in light from all sides. What the surface mirrors
// of the beam is left out. Flights by Woodcock's method, at the greatest extinction of all resins.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "photons.h"

enum { MOST = 256, LAYERS = 16 };

static double number(void) {
    double value;
    if (scanf("%lf", &value) != 1) exit(2);
    return value;
}

int main(int count, char **word) {
    if (count != 3) return 2;
    long photons = atol(word[1]);
    double index = number(), scattering[MOST], extinction[MOST], g[MOST], greatest = 0;
    int resins = number();
    for (int i = 0; i < resins; i++) {
        scattering[i] = number(), extinction[i] = scattering[i] + number(), g[i] = number();
        greatest = fmax(greatest, extinction[i]);
    }
    int stacks = number(), resin[MOST][LAYERS], layers[MOST];
    double until[MOST][LAYERS], bottom = 0;
    for (int i = 0; i < stacks; i++) {
        double depth = 0;
        layers[i] = number();
        for (int k = 0; k < layers[i]; k++) resin[i][k] = number(), until[i][k] = depth += number();
        bottom = fmax(bottom, depth);
    }
    int columns = number(), rows = number();
    double side = number();
    int *square = malloc(sizeof(int) * columns * rows);
    for (int i = 0; i < columns * rows; i++) square[i] = number();
    int fields = number();
    for (int field = 0; field < fields; field++) {
        double low[2] = {number(), number()}, high[2] = {number(), number()}, sum = 0, squares = 0;
        seed(strtoull(word[2], 0, 10) * 1000003 + field);
        for (long photon = 0; photon < photons; photon++) {
            double x = low[0] + (high[0] - low[0]) * draw(), y = low[1] + (high[1] - low[1]) * draw(), z = 0;
            double ux = 0, uy = 0, uz = 1, weight = 1, out = 0;
            if (draw() < mirrored(1, 1, index)) continue;
            for (;;) {
                double length = -log(draw()) / greatest;
                if (uz < 0 && -z / uz <= length) {
                    double way = -z / uz;
                    x += ux * way, y += uy * way, z = 0;
                    if (draw() >= mirrored(-uz, index, 1)) {
                        out = weight;
                        break;
                    }
                    uz = -uz;
                    continue;
                }
                x += ux * length, y += uy * length, z += uz * length;
                int column = (int)floor(x / side), row = (int)floor(y / side);
                if (z >= bottom || column < 0 || column >= columns || row < 0 || row >= rows) break;
                int stack = square[column + columns * row], layer = 0;
                while (layer + 1 < layers[stack] && z >= until[stack][layer]) layer++;
                int here = resin[stack][layer];
                if (draw() * greatest >= extinction[here]) continue;
                weight *= scattering[here] / extinction[here];
                if (weight < 0.02 && draw() < 0.5) break;
                if (weight < 0.02) weight *= 2;
                double f = g[here], q = (1 - f * f) / (1 - f + 2 * f * draw());
                double turn = fabs(f) < 1e-6 ? 2 * draw() - 1 : (1 + f * f - q * q) / (2 * f);
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
            sum += out, squares += out * out;
        }
        double mean = sum / photons;
        printf("%.9g %.9g\n", mean, sqrt(fmax(0, squares / photons - mean * mean) / photons));
        fflush(stdout);
    }
}
