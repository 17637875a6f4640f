/* The least that a quiet step of one mode a body takes if it is taken by itself: a turn of two
 * modes, the answer to a quintic through two nodes of the surface, eight columns, contact and chip
 * watched, and nothing else.
 *
 * Compiled and measured by floor.py. Coefficients are given, so no figure of it is one of physics.
 */
#include <stdint.h>

typedef struct { double height, slope, curvature, spare; } Node;

/* z: 4 coordinates; turn: 4 x 2, answer: 4 x 6, outputs: 5 x 8; nodes: a ring of `turns` steps. */
int64_t take_steps(double *restrict z, const double *restrict turn, const double *restrict answer,
                   const double *restrict outputs, Node *restrict nodes, int64_t turns,
                   double *restrict out, int64_t steps)
{
    double u0 = 0.0, d0 = 0.0, e0 = 0.0, r0 = 0.0, s0 = 0.0, b0 = 0.0, v0 = 0.0;
    double now[4] = {z[0], z[1], z[2], z[3]};
    int64_t place = 0, k;
    for (k = 0; k < steps; k++) {
        const Node *node = nodes + place;
        double u1 = node->height - 5e-5, d1 = node->slope, e1 = node->curvature;
        double next[4], o[8];
        for (int i = 0; i < 4; i++) {
            next[i] = turn[2 * i] * now[i] + turn[2 * i + 1] * now[i ^ 2];
            const double *a = answer + i;
            next[i] += ((a[0] * u0 + a[4] * d0) + (a[8] * e0 + a[12] * u1))
                       + (a[16] * d1 + a[20] * e1);
        }
        for (int j = 0; j < 8; j++) {
            o[j] = outputs[32 + j];
            for (int i = 0; i < 4; i++) o[j] += outputs[8 * i + j] * next[i];
        }
        double r1 = o[0] - o[2], s1 = o[1] - o[3], b1 = o[5], v1 = o[6], chip = r1 - u1;
        int happens = b1 > 5e-5 || (v0 > 0.0 && v1 < 0.0 && b0 + v0 > 5e-5) || chip < 0.0
            || (s0 - d0 < 0.0 && s1 - d1 > 0.0 && r0 - u0 + s0 - d0 < 0.0);
        if (happens) break;
        nodes[place].height = r1;
        nodes[place].slope = s1;
        nodes[place].curvature = o[4] + 0.01 * u1;
        if (++place == turns) place = 0;
        double *row = out + 8 * k;
        row[0] = (k + 1) * 1e-4;
        row[1] = (k + 1) * 5e-3;
        row[2] = o[0], row[3] = o[1] * 1e4, row[4] = o[2], row[5] = o[3] * 1e4;
        row[6] = chip, row[7] = 400.0 * chip;
        for (int i = 0; i < 4; i++) now[i] = next[i];
        u0 = u1, d0 = d1, e0 = e1, r0 = r1, s0 = s1, b0 = b1, v0 = v1;
    }
    for (int i = 0; i < 4; i++) z[i] = now[i];
    return k;
}
