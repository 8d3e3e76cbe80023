/* light_field.cl: one bounce, L_o = L_e + K (L_fixed + G L_o), for blocks of sixteen elements of one roughness level.
 *
 * The matrices K are the same for all elements, so sixteen elements ride in the lanes of a float16: a weight is read once and
 * used sixteen times.  Arrays of a block are [bin][channel][lane].
 *     L_o = dx (E/pi - Y) + dy Y + F0 A + F90 B          dx = d (1 - F0), dy = d (1 - F90)
 * Nguyen et al. 2013, 5.2 and 6.2.
 */
#include "links.cl"

#define LANES 16
#define Q_BINS (D_BINS / 4)
#ifndef STREAMED
#define STREAMED 0
#endif

inline int coarse_of_bin(int d) { return (d / SIDE / 2) * (SIDE / 2) + (d % SIDE) / 2; }

/* light arriving at a block's elements: fixed light plus what the elements that they see send back
 * order     (blocks * 16) element of each lane, -1 for none
 * hit       (N, D) packed links
 * fixed     (N, D, 3) light that no edit changes; with STREAMED it and hit are of the lanes of these blocks: (blocks * 16, D)
 * outgoing  (N, D, 3)
 * light     (blocks, D, 3) float16: result
 */
__kernel void gather(__global const int *order, __global const uint *hit, __global const light_t *fixed,
                     __global const light_t *outgoing, const int first_block, __global float *light)
{
    int d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS) return;
    float r[LANES], g[LANES], b[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[(first_block + block) * LANES + lane];
        float3 v = (float3)(0.0f);
        if (e >= 0) {
            size_t at = (size_t)(STREAMED ? block * LANES + lane : e) * D_BINS + d;
            uint h = hit[at];
            v = load_light(fixed, at);
            if (IS_LINK(h)) v += load_light(outgoing, h);
        }
        r[lane] = v.x; g[lane] = v.y; b[lane] = v.z;
    }
    __global float *to = light + ((size_t)block * D_BINS + d) * 3 * LANES;
    for (int lane = 0; lane < LANES; lane++) {
        to[lane] = r[lane]; to[LANES + lane] = g[lane]; to[2 * LANES + lane] = b[lane];
    }
}

/* means over two by two bins
 * light   (blocks, D, 3) float16
 * coarse  (blocks, Q, 3) float16: result
 */
__kernel void coarsen(__global const float16 *light, __global float16 *coarse)
{
    int q = get_global_id(0), block = get_global_id(1);
    if (q >= Q_BINS) return;
    int d = (q / (SIDE / 2)) * 2 * SIDE + (q % (SIDE / 2)) * 2;
    __global const float16 *from = light + (size_t)block * D_BINS * 3;
    for (int c = 0; c < 3; c++)
        coarse[((size_t)block * Q_BINS + q) * 3 + c] = 0.25f * (from[d * 3 + c] + from[(d + 1) * 3 + c] +
                                                               from[(d + SIDE) * 3 + c] + from[(d + SIDE + 1) * 3 + c]);
}

/* irradiance over pi
 * light    (blocks, D, 3) float16
 * cosine   (D) cosines of the bins, scaled to the sum 1
 * e_pi     (blocks, 3) float16: result
 */
__kernel void irradiance(__global const float16 *light, __global const float *cosine, __global float16 *e_pi)
{
    int c = get_global_id(0), block = get_global_id(1);
    if (c >= 3) return;
    float16 sum = 0.0f;
    __global const float16 *from = light + (size_t)block * D_BINS * 3 + c;
    for (int d = 0; d < D_BINS; d++) sum += cosine[d] * from[d * 3];
    e_pi[block * 3 + c] = sum;
}

inline void add_to(__global light_t *outgoing, __global const int *order, int at, int d, const float16 *v)
{
    float rgb[3][LANES];
    for (int c = 0; c < 3; c++) vstore16(v[c], 0, rgb[c]);
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[at + lane];
        if (e < 0) continue;
        size_t to = ((size_t)e * D_BINS + d) * 3;
        for (int c = 0; c < 3; c++) add_light(rgb[c][lane], outgoing, to + c);
    }
}

/* the basis of symmetry.py: H x H cells of a quarter of the coarse map, each of which stands for four bins */
#define H (SIDE / 4)
#define CELLS (H * H)
#define ALIKE (H * (H + 1) / 2)
#define OPPOSITE (H * (H - 1) / 2)
#define ODD (ALIKE + OPPOSITE) /* first of those that are odd under both flips */
#define EVEN_ODD (2 * ODD)
#define ODD_EVEN (2 * ODD + CELLS)
#define COLUMNS (LOBE ? 3 : 1) /* Y, A, B */

inline int alike_of(int y, int x) { return y * H - y * (y - 1) / 2 + x - y; }                /* y <= x */
inline int opposite_of(int y, int x) { return y * (H - 1) - y * (y - 1) / 2 + x - y - 1; } /* y < x */
inline int folded_bin(int y, int x, int low, int left) { return (low ? 2 * H - 1 - y : y) * 2 * H + (left ? 2 * H - 1 - x : x); }

/* light into the basis
 * coarse  (blocks, Q, 3) float16
 * folded  (blocks, Q, 3) float16: result
 */
__kernel void fold(__global const float16 *coarse, __global float16 *folded)
{
    int cell = get_global_id(0), block = get_global_id(1);
    if (cell >= CELLS) return;
    int y = cell / H, x = cell % H;
    __global const float16 *from = coarse + (size_t)block * Q_BINS * 3;
    __global float16 *to = folded + (size_t)block * Q_BINS * 3;
    for (int c = 0; c < 3; c++) {
        float16 v[2][2]; /* low, left */
        for (int k = 0; k < 4; k++) v[k / 2][k % 2] = from[folded_bin(y, x, k / 2, k % 2) * 3 + c];
        to[(EVEN_ODD + cell) * 3 + c] = v[0][0] + v[1][0] - v[0][1] - v[1][1];
        to[(ODD_EVEN + x * H + y) * 3 + c] = v[0][0] + v[0][1] - v[1][0] - v[1][1];
        if (y > x) continue;
        float16 even = v[0][0] + v[0][1] + v[1][0] + v[1][1], odd = v[0][0] - v[0][1] - v[1][0] + v[1][1];
        if (y < x) { /* with the cell across the diagonal */
            for (int k = 0; k < 4; k++) v[k / 2][k % 2] = from[folded_bin(x, y, k / 2, k % 2) * 3 + c];
            float16 even_2 = v[0][0] + v[0][1] + v[1][0] + v[1][1], odd_2 = v[0][0] - v[0][1] - v[1][0] + v[1][1];
            to[(ALIKE + opposite_of(y, x)) * 3 + c] = even - even_2;
            to[(ODD + ALIKE + opposite_of(y, x)) * 3 + c] = odd - odd_2;
            even += even_2;
            odd += odd_2;
        }
        to[alike_of(y, x) * 3 + c] = even;
        to[(ODD + alike_of(y, x)) * 3 + c] = odd;
    }
}

/* the columns Y, and with LOBE A and B of a rough lobe, in the basis
 * folded   (blocks, Q, 3) float16
 * y, a, b  blocks of the matrices one after another, row by row
 * answer   (blocks, Q, COLUMNS, 3) float16: result
 */
__kernel void reflect_folded(__global const float16 *folded, __global const float *y, __global const float *a,
                             __global const float *b, __global float16 *answer)
{
    int q = get_global_id(0), block = get_global_id(1);
    if (q >= Q_BINS) return;
    int size = CELLS, first = q < ODD_EVEN ? EVEN_ODD : ODD_EVEN, matrix = 2 * (ALIKE * ALIKE + OPPOSITE * OPPOSITE);
    if (q < EVEN_ODD) {
        int odd = q >= ODD, opposite = q - odd * ODD >= ALIKE;
        size = opposite ? OPPOSITE : ALIKE;
        first = odd * ODD + opposite * ALIKE;
        matrix = odd * (ALIKE * ALIKE + OPPOSITE * OPPOSITE) + opposite * ALIKE * ALIKE;
    }
    __global const float16 *light = folded + ((size_t)block * Q_BINS + first) * 3;
    matrix += (q - first) * size;
    float16 ys[3] = {0.0f, 0.0f, 0.0f};
#if LOBE
    float16 as[3] = {0.0f, 0.0f, 0.0f}, bs[3] = {0.0f, 0.0f, 0.0f};
#endif
    for (int k = 0; k < size; k++) {
        float wy = y[matrix + k];
        float16 r = light[k * 3], g = light[k * 3 + 1], bl = light[k * 3 + 2];
        ys[0] += wy * r; ys[1] += wy * g; ys[2] += wy * bl;
#if LOBE
        float wa = a[matrix + k], wb = b[matrix + k];
        as[0] += wa * r; as[1] += wa * g; as[2] += wa * bl;
        bs[0] += wb * r; bs[1] += wb * g; bs[2] += wb * bl;
#endif
    }
    __global float16 *to = answer + ((size_t)block * Q_BINS + q) * COLUMNS * 3;
    for (int c = 0; c < 3; c++) {
        to[c] = ys[c];
#if LOBE
        to[3 + c] = as[c];
        to[6 + c] = bs[c];
#endif
    }
}

/* diffuse reflection, and with LOBE a rough lobe too, from the basis to the bins
 * answer      (blocks, Q, COLUMNS, 3) float16
 * e_pi        (blocks, 3) float16
 * y_scale     (D); lobe_scale (D, 2): coarse to fine albedo
 * parameters  (blocks, 12) float16: dx, dy, F0, F90, each of three channels
 * outgoing    (N, D, 3): added to
 */
__kernel void unfold(__global const float16 *answer, __global const float16 *e_pi, __global const float *y_scale,
                     __global const float2 *lobe_scale, __global const float16 *parameters, __global const int *order,
                     const int first_block, __global light_t *outgoing)
{
    int cell = get_global_id(0), block = get_global_id(1);
    if (cell >= CELLS) return;
    int y = cell / H, x = cell % H, low_y = min(y, x), high_x = max(y, x);
    int alike = alike_of(low_y, high_x), opposite = ALIKE + (y == x ? 0 : opposite_of(low_y, high_x));
    float sign = y < x ? 1.0f : y > x ? -1.0f : 0.0f;
    __global const float16 *from = answer + (size_t)block * Q_BINS * COLUMNS * 3;
    float16 coarse[4][COLUMNS * 3]; /* low and left, as folded_bin */
    for (int c = 0; c < COLUMNS * 3; c++) {
        float16 even = from[alike * COLUMNS * 3 + c] + sign * from[opposite * COLUMNS * 3 + c];
        float16 odd = from[(ODD + alike) * COLUMNS * 3 + c] + sign * from[(ODD + opposite) * COLUMNS * 3 + c];
        float16 across = from[(EVEN_ODD + cell) * COLUMNS * 3 + c];
        float16 down = from[(ODD_EVEN + x * H + y) * COLUMNS * 3 + c];
        coarse[0][c] = even + odd + across + down;
        coarse[1][c] = even - odd - across + down;
        coarse[2][c] = even - odd + across - down;
        coarse[3][c] = even + odd - across - down;
    }
    __global const float16 *p = parameters + (size_t)(first_block + block) * 12;
    for (int k = 0; k < 16; k++) {
        int q = folded_bin(y, x, k / 8, k / 4 % 2);
        int d = ((q / (SIDE / 2)) * 2 + k / 2 % 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2;
        float16 v[3];
        for (int c = 0; c < 3; c++) {
            float16 yv = coarse[k / 4][c] * y_scale[d];
            v[c] = p[c] * (e_pi[block * 3 + c] - yv) + p[3 + c] * yv;
#if LOBE
            v[c] += p[6 + c] * coarse[k / 4][3 + c] * lobe_scale[d].x + p[9 + c] * coarse[k / 4][6 + c] * lobe_scale[d].y;
#endif
        }
        add_to(outgoing, order, (first_block + block) * LANES, d, v);
    }
}

/* a sharp lobe from the largest weights of each row
 * light       (blocks, D, 3) float16
 * first       (D + 1) rows of tap, a, b
 * others as above
 */
__kernel void reflect_sharp(__global const float16 *light, __global const int *first, __global const ushort *tap,
                            __global const float *a, __global const float *b, __global const float16 *parameters,
                            __global const int *order, const int first_block, __global light_t *outgoing)
{
    int d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS) return;
    float16 as[3], bs[3];
    sharp_row(light + (size_t)block * D_BINS * 3, first[d], first[d + 1], tap, a, b, as, bs);
    __global const float16 *p = parameters + (size_t)(first_block + block) * 12;
    float16 v[3];
    for (int c = 0; c < 3; c++) v[c] = p[6 + c] * as[c] + p[9 + c] * bs[c];
    add_to(outgoing, order, (first_block + block) * LANES, d, v);
}

inline float sum_lanes(float16 v)
{
    float8 a = v.lo + v.hi;
    float4 b = a.lo + a.hi;
    return b.x + b.y + b.z + b.w;
}

/* every bin of an element starts from what it emits
 * emission (N, 3); outgoing (N, D, 3): result; count = N * D
 */
__kernel void emit(__global const float *emission, const uint count, __global light_t *outgoing)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    store_light(load3(emission, i / D_BINS), outgoing, i);
}

/* what elements emit more, or less, in every bin
 * change (N, 3); outgoing (N, D, 3): in and out; count = N * D
 */
__kernel void emit_more(__global const float *change, const uint count, __global light_t *outgoing)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    float3 sum = load_light(outgoing, i) + load3(change, i / D_BINS);
    float3 lit = (float3)(sum.x > 0.0f ? sum.x : 0.0f, sum.y > 0.0f ? sum.y : 0.0f, sum.z > 0.0f ? sum.z : 0.0f);
    store_light(lit, outgoing, i);
}

/* how far two light fields are apart, element by element
 * old, now   (N, D, 3)
 * difference (N, 2): sums of |now - old| and of |now|
 */
__kernel void difference(__global const light_t *old, __global const light_t *now, const uint count,
                         __global float *difference)
{
    uint e = get_global_id(0);
    if (e >= count) return;
    size_t at = (size_t)e * D_BINS * 3;
    float16 apart = 0.0f, all = 0.0f;
    for (int k = 0; k < D_BINS * 3; k += LANES) {
        float16 v = load_light16(now + at + k);
        apart += fabs(v - load_light16(old + at + k));
        all += fabs(v);
    }
    difference[2 * e] = sum_lanes(apart);
    difference[2 * e + 1] = sum_lanes(all);
}

/* the light that each element sends
 * outgoing (N, D, 3)
 * sum      (N): result, over bins and channels
 */
__kernel void sum_of_elements(__global const light_t *outgoing, const uint count, __global float *sum)
{
    uint e = get_global_id(0);
    if (e >= count) return;
    __global const light_t *of = outgoing + (size_t)e * D_BINS * 3;
    float16 all = 0.0f;
    for (int k = 0; k < D_BINS * 3; k += 16) all += fabs(load_light16(of + k));
    sum[e] = sum_lanes(all);
}
