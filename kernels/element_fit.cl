/* element_fit.cl: products of what each roughness level makes of the light at each element, all that least squares need.
 *
 * Blocks of sixteen elements in the lanes of a float16, as in light_field.cl.  For the light that arrives now, the columns
 * X, Y (diffuse) and A, B (of a level) are built bin by bin, and multiplied with each other and with a wanted light T:
 *     X.X X.Y Y.Y X.T Y.T T.T                                                      once
 *     A.A A.B B.B X.A X.B Y.A Y.B A.T B.T   A.A' A.B' B.A' B.B'                    of each level; ' is the level before
 * Products with the level before make those of every roughness between two levels exact.
 * Nguyen et al. 2013, 5.3: C = A'A, d = A'b for every element and glossiness.
 */
#include "common.cl"

#define LANES 16
#define Q_BINS (D_BINS / 4)
#define PARTS 8

/* wanted light of a block's elements
 * order   (blocks * 16) element of each lane, -1 for none
 * wanted  (N, D, 3)
 * block   (blocks, D, 3) float16: result
 */
__kernel void gather_wanted(__global const int *order, __global const float *wanted, const int first_block,
                            __global float *block)
{
    int d = get_global_id(0), b = get_global_id(1);
    if (d >= D_BINS) return;
    __global float *to = block + ((size_t)b * D_BINS + d) * 3 * LANES;
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[(first_block + b) * LANES + lane];
        float3 v = e >= 0 ? load3(wanted, (size_t)e * D_BINS + d) : (float3)(0.0f);
        to[lane] = v.x; to[LANES + lane] = v.y; to[2 * LANES + lane] = v.z;
    }
}

/* X and Y
 * coarse   (blocks, Q, 3) float16 light; e_pi (blocks, 3) float16
 * y        (Q, Q); y_scale (D)
 * columns  (2, blocks, D, 3) float16: result
 */
__kernel void diffuse_columns(__global const float16 *coarse, __global const float16 *e_pi, __global const float *y,
                              __global const float *y_scale, const int blocks, __global float16 *columns)
{
    int q = get_global_id(0), b = get_global_id(1);
    if (q >= Q_BINS) return;
    __global const float16 *light = coarse + (size_t)b * Q_BINS * 3;
    float16 ys[3] = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < Q_BINS; k++)
        for (int c = 0; c < 3; c++) ys[c] += y[q * Q_BINS + k] * light[k * 3 + c];
    for (int k = 0; k < 4; k++) {
        int d = ((q / (SIDE / 2)) * 2 + k / 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2;
        for (int c = 0; c < 3; c++) {
            float16 v = ys[c] * y_scale[d];
            columns[((size_t)b * D_BINS + d) * 3 + c] = e_pi[b * 3 + c] - v;
            columns[((size_t)(blocks + b) * D_BINS + d) * 3 + c] = v;
        }
    }
}

/* A and B of a rough level
 * a, b        (Q, Q); lobe_scale (D, 2)
 * columns     (2, blocks, D, 3) float16: result
 */
__kernel void coarse_columns(__global const float16 *coarse, __global const float *a, __global const float *b,
                             __global const float2 *lobe_scale, const int blocks, __global float16 *columns)
{
    int q = get_global_id(0), block = get_global_id(1);
    if (q >= Q_BINS) return;
    __global const float16 *light = coarse + (size_t)block * Q_BINS * 3;
    float16 as[3] = {0.0f, 0.0f, 0.0f}, bs[3] = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < Q_BINS; k++) {
        float wa = a[q * Q_BINS + k], wb = b[q * Q_BINS + k];
        float16 r = light[k * 3], g = light[k * 3 + 1], bl = light[k * 3 + 2];
        as[0] += wa * r; as[1] += wa * g; as[2] += wa * bl;
        bs[0] += wb * r; bs[1] += wb * g; bs[2] += wb * bl;
    }
    for (int k = 0; k < 4; k++) {
        int d = ((q / (SIDE / 2)) * 2 + k / 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2;
        for (int c = 0; c < 3; c++) {
            columns[((size_t)block * D_BINS + d) * 3 + c] = as[c] * lobe_scale[d].x;
            columns[((size_t)(blocks + block) * D_BINS + d) * 3 + c] = bs[c] * lobe_scale[d].y;
        }
    }
}

/* A and B of a sharp level
 * light    (blocks, D, 3) float16
 * first    (D + 1) rows of tap, a, b
 */
__kernel void sharp_columns(__global const float16 *light, __global const int *first, __global const ushort *tap,
                            __global const float *a, __global const float *b, const int blocks, __global float16 *columns)
{
    int d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS) return;
    __global const float16 *from = light + (size_t)block * D_BINS * 3;
    float16 as[3] = {0.0f, 0.0f, 0.0f}, bs[3] = {0.0f, 0.0f, 0.0f};
    for (int k = first[d]; k < first[d + 1]; k++) {
        int s = tap[k] * 3;
        for (int c = 0; c < 3; c++) {
            as[c] += a[k] * from[s + c];
            bs[c] += b[k] * from[s + c];
        }
    }
    for (int c = 0; c < 3; c++) {
        columns[((size_t)block * D_BINS + d) * 3 + c] = as[c];
        columns[((size_t)(blocks + block) * D_BINS + d) * 3 + c] = bs[c];
    }
}

/* sums over an eighth of the bins
 * xy      (2, blocks, D, 3) float16; wanted (blocks, D, 3) float16
 * sums    (blocks, 8, 3, 6) float16: result
 */
__kernel void fixed_products(__global const float16 *xy, __global const float16 *wanted, const int blocks,
                             __global float16 *sums)
{
    int c = get_global_id(0), part = get_global_id(1), block = get_global_id(2);
    if (c >= 3) return;
    float16 s[6];
    for (int i = 0; i < 6; i++) s[i] = 0.0f;
    for (int d = part * (D_BINS / PARTS); d < (part + 1) * (D_BINS / PARTS); d++) {
        float16 x = xy[((size_t)block * D_BINS + d) * 3 + c], y = xy[((size_t)(blocks + block) * D_BINS + d) * 3 + c];
        float16 t = wanted[((size_t)block * D_BINS + d) * 3 + c];
        s[0] += x * x; s[1] += x * y; s[2] += y * y; s[3] += x * t; s[4] += y * t; s[5] += t * t;
    }
    for (int i = 0; i < 6; i++) sums[((block * PARTS + part) * 3 + c) * 6 + i] = s[i];
}

/* the same of one level
 * ab, before  (2, blocks, D, 3) float16: of the level and of the one before
 * sums        (blocks, 8, 3, 13) float16: result
 */
__kernel void level_products(__global const float16 *xy, __global const float16 *ab, __global const float16 *before,
                             __global const float16 *wanted, const int blocks, __global float16 *sums)
{
    int c = get_global_id(0), part = get_global_id(1), block = get_global_id(2);
    if (c >= 3) return;
    float16 s[13];
    for (int i = 0; i < 13; i++) s[i] = 0.0f;
    for (int d = part * (D_BINS / PARTS); d < (part + 1) * (D_BINS / PARTS); d++) {
        size_t one = ((size_t)block * D_BINS + d) * 3 + c, two = ((size_t)(blocks + block) * D_BINS + d) * 3 + c;
        float16 x = xy[one], y = xy[two], a = ab[one], b = ab[two], p = before[one], q = before[two], t = wanted[one];
        s[0] += a * a; s[1] += a * b; s[2] += b * b;
        s[3] += x * a; s[4] += x * b; s[5] += y * a; s[6] += y * b;
        s[7] += a * t; s[8] += b * t;
        s[9] += a * p; s[10] += a * q; s[11] += b * p; s[12] += b * q;
    }
    for (int i = 0; i < 13; i++) sums[((block * PARTS + part) * 3 + c) * 13 + i] = s[i];
}
