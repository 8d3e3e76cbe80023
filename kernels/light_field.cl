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

inline void put_lanes(__global light_t *outgoing, __global const int *order, int at, int d, int adds, const float16 *v)
{
    float rgb[3][LANES];
    for (int c = 0; c < 3; c++) vstore16(v[c], 0, rgb[c]);
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[at + lane];
        if (e < 0) continue;
        size_t to = (size_t)e * D_BINS + d;
        float3 sum = (float3)(rgb[0][lane], rgb[1][lane], rgb[2][lane]);
        if (adds) sum += load_light(outgoing, to);
        store_light(sum, outgoing, to);
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
/* lobes of a block, two where its elements lie between two levels: rough ones in coarse bins, sharp ones in fine bins */
#ifndef ROUGH
#define ROUGH 0
#endif
#ifndef SHARP
#define SHARP 0
#endif
#define COLUMNS (1 + 2 * ROUGH)              /* Y, and A, B of each rough lobe */
#define PARAMETERS (6 + 6 * (ROUGH + SHARP)) /* dx, dy, then F0, F90 of the share of each lobe, sharp ones first */

inline int alike_of(int y, int x) { return y * H - y * (y - 1) / 2 + x - y; }                /* y <= x */
inline int opposite_of(int y, int x) { return y * (H - 1) - y * (y - 1) / 2 + x - y - 1; } /* y < x */
inline int folded_bin(int y, int x, int low, int left) { return (low ? 2 * H - 1 - y : y) * 2 * H + (left ? 2 * H - 1 - x : x); }
inline int fine_bin(int q, int k) { return ((q / (SIDE / 2)) * 2 + k / 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2; }

/* light arriving at a block's elements, in the basis; one work-item a cell and the one across the diagonal
 * cosine    (D) cosines of the bins, scaled to the sum 1
 * folded    (blocks, Q, 3) float16: result
 * e_part    (blocks, ALIKE, 3) float16: result, parts of the irradiance over pi
 * light     (blocks, D, 3) float16: result, where there are sharp lobes
 * others as of gather
 */
__kernel void gather_folded(__global const int *order, __global const uint *hit, __global const light_t *fixed,
                            __global const light_t *outgoing, __global const float *cosine, const int first_block,
                            __global float16 *folded, __global float16 *e_part, __global float16 *light)
{
    int item = get_global_id(0), block = get_global_id(1);
    if (item >= ALIKE) return;
    int y = 0, x = item;
    while (x >= H - y) { x -= H - y; y++; }
    x += y;
    __global float16 *to = folded + (size_t)block * Q_BINS * 3;
    __global const int *elements = order + (first_block + block) * LANES;
    float16 even[2][3], odd[2][3], e_pi[3];
    for (int c = 0; c < 3; c++) e_pi[c] = 0.0f;
    for (int side = 0; side < (y < x ? 2 : 1); side++) {
        int cy = side ? x : y, cx = side ? y : x;
        float16 v[4][3];
        for (int k = 0; k < 4; k++) {
            int q = folded_bin(cy, cx, k / 2, k % 2);
            float16 sum[3];
            for (int c = 0; c < 3; c++) sum[c] = 0.0f;
            for (int m = 0; m < 4; m++) {
                int d = fine_bin(q, m);
                /* without branches, so that many reads are under way at once; lanes of none read the first bin, times zero */
                float rgb[3][LANES], share[LANES], there[LANES];
                size_t at[LANES], from[LANES];
                for (int lane = 0; lane < LANES; lane++) {
                    int e = elements[lane];
                    there[lane] = e >= 0 ? 1.0f : 0.0f;
                    at[lane] = (size_t)(STREAMED ? block * LANES + lane : e >= 0 ? e : 0) * D_BINS + d;
                }
                for (int lane = 0; lane < LANES; lane++) {
                    uint h = hit[at[lane]];
                    share[lane] = IS_LINK(h) ? there[lane] : 0.0f;
                    from[lane] = IS_LINK(h) ? h : 0;
                }
                for (int c = 0; c < 3; c++)
                    for (int lane = 0; lane < LANES; lane++)
                        rgb[c][lane] = there[lane] * light_at(fixed, 3 * at[lane] + c) + share[lane] * light_at(outgoing, 3 * from[lane] + c);
                for (int c = 0; c < 3; c++) {
                    float16 a = vload16(0, rgb[c]);
                    sum[c] += a;
                    e_pi[c] += cosine[d] * a;
#if SHARP
                    light[((size_t)block * D_BINS + d) * 3 + c] = a;
#endif
                }
            }
            for (int c = 0; c < 3; c++) v[k][c] = 0.25f * sum[c];
        }
        for (int c = 0; c < 3; c++) {
            to[(EVEN_ODD + cy * H + cx) * 3 + c] = v[0][c] + v[2][c] - v[1][c] - v[3][c];
            to[(ODD_EVEN + cx * H + cy) * 3 + c] = v[0][c] + v[1][c] - v[2][c] - v[3][c];
            even[side][c] = v[0][c] + v[1][c] + v[2][c] + v[3][c];
            odd[side][c] = v[0][c] - v[1][c] - v[2][c] + v[3][c];
        }
    }
    for (int c = 0; c < 3; c++) {
        if (y < x) {
            to[(ALIKE + opposite_of(y, x)) * 3 + c] = even[0][c] - even[1][c];
            to[(ODD + ALIKE + opposite_of(y, x)) * 3 + c] = odd[0][c] - odd[1][c];
            even[0][c] += even[1][c];
            odd[0][c] += odd[1][c];
        }
        to[item * 3 + c] = even[0][c];
        to[(ODD + item) * 3 + c] = odd[0][c];
        e_part[((size_t)block * ALIKE + item) * 3 + c] = e_pi[c];
    }
}

/* the columns Y, and A and B of rough lobes, in the basis
 * folded   (blocks, Q, 3) float16
 * y, a, b  blocks of the matrices one after another, row by row; a_2, b_2 of the second rough lobe
 * e_part   (blocks, ALIKE, 3) float16; e_pi (blocks, 3) float16: result, their sum, the irradiance over pi
 * answer   (blocks, Q, COLUMNS, 3) float16: result
 */
__kernel void reflect_folded(__global const float16 *folded, __global const float *y, __global const float *a,
                             __global const float *b, __global const float *a_2, __global const float *b_2,
                             __global const float16 *e_part, __global float16 *e_pi, __global float16 *answer)
{
    int q = get_global_id(0), block = get_global_id(1);
    if (q >= Q_BINS) return;
    if (q < 3) {
        float16 all = 0.0f;
        for (int k = 0; k < ALIKE; k++) all += e_part[((size_t)block * ALIKE + k) * 3 + q];
        e_pi[block * 3 + q] = all;
    }
    int size = CELLS, first = q < ODD_EVEN ? EVEN_ODD : ODD_EVEN, matrix = 2 * (ALIKE * ALIKE + OPPOSITE * OPPOSITE);
    if (q < EVEN_ODD) {
        int odd = q >= ODD, opposite = q - odd * ODD >= ALIKE;
        size = opposite ? OPPOSITE : ALIKE;
        first = odd * ODD + opposite * ALIKE;
        matrix = odd * (ALIKE * ALIKE + OPPOSITE * OPPOSITE) + opposite * ALIKE * ALIKE;
    }
    __global const float16 *light = folded + ((size_t)block * Q_BINS + first) * 3;
    matrix += (q - first) * size;
    float16 sum[COLUMNS][3];
    for (int k = 0; k < COLUMNS; k++) for (int c = 0; c < 3; c++) sum[k][c] = 0.0f;
    for (int k = 0; k < size; k++) {
        float16 r[3] = {light[k * 3], light[k * 3 + 1], light[k * 3 + 2]};
        float w[COLUMNS];
        w[0] = y[matrix + k];
#if ROUGH
        w[1] = a[matrix + k]; w[2] = b[matrix + k];
#endif
#if ROUGH > 1
        w[3] = a_2[matrix + k]; w[4] = b_2[matrix + k];
#endif
        for (int n = 0; n < COLUMNS; n++) for (int c = 0; c < 3; c++) sum[n][c] += w[n] * r[c];
    }
    __global float16 *to = answer + ((size_t)block * Q_BINS + q) * COLUMNS * 3;
    for (int n = 0; n < COLUMNS; n++) for (int c = 0; c < 3; c++) to[n * 3 + c] = sum[n][c];
}

/* one sharp lobe from the largest weights of each row
 * light       (blocks, D, 3) float16
 * first       (D + 1) rows of tap, a, b
 * number      of the lobe among those of a block; the first one writes, another adds
 * parameters  (blocks, PARAMETERS) float16, of three channels each
 * sharp       (blocks, D, 3) float16: result
 */
__kernel void reflect_sharp(__global const float16 *light, __global const int *first, __global const ushort *tap,
                            __global const float *a, __global const float *b, __global const float16 *parameters,
                            const int first_block, const int number, __global float16 *sharp)
{
    int d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS) return;
    float16 as[3], bs[3];
    sharp_row(light + (size_t)block * D_BINS * 3, first[d], first[d + 1], tap, a, b, as, bs);
    __global const float16 *p = parameters + (size_t)(first_block + block) * PARAMETERS + 6 + 6 * number;
    __global float16 *to = sharp + ((size_t)block * D_BINS + d) * 3;
    for (int c = 0; c < 3; c++) {
        float16 v = p[c] * as[c] + p[3 + c] * bs[c];
        to[c] = number ? to[c] + v : v;
    }
}

/* what elements send out, from the basis to the bins
 * answer      (blocks, Q, COLUMNS, 3) float16; sharp (blocks, D, 3) float16
 * e_pi        (blocks, 3) float16
 * y_scale     (D); lobe_scale, lobe_scale_2 (D, 2): coarse to fine albedo
 * parameters  (blocks, PARAMETERS) float16
 * emission    (N, 3)
 * adds        to what is there; else that is emission
 * outgoing    (N, D, 3): rows of the blocks' elements are written
 */
__kernel void unfold(__global const float16 *answer, __global const float16 *sharp, __global const float16 *e_pi,
                     __global const float *y_scale, __global const float2 *lobe_scale, __global const float2 *lobe_scale_2,
                     __global const float16 *parameters, __global const float *emission, __global const int *order,
                     const int first_block, const int adds, __global light_t *outgoing)
{
    int cell = get_global_id(0), block = get_global_id(1);
    if (cell >= CELLS) return;
    int y = cell / H, x = cell % H, low_y = min(y, x), high_x = max(y, x), at = (first_block + block) * LANES;
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
    __global const float16 *p = parameters + (size_t)(first_block + block) * PARAMETERS;
    float glow[3][LANES];
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[at + lane];
        float3 g = adds || e < 0 ? (float3)(0.0f) : load3(emission, e);
        glow[0][lane] = g.x; glow[1][lane] = g.y; glow[2][lane] = g.z;
    }
    for (int k = 0; k < 16; k++) {
        int d = fine_bin(folded_bin(y, x, k / 8, k / 4 % 2), k % 4);
        float16 v[3];
        for (int c = 0; c < 3; c++) {
            float16 yv = coarse[k / 4][c] * y_scale[d];
            v[c] = vload16(0, glow[c]) + p[c] * (e_pi[block * 3 + c] - yv) + p[3 + c] * yv;
#if SHARP
            v[c] += sharp[((size_t)block * D_BINS + d) * 3 + c];
#endif
#if ROUGH
            __global const float16 *of = p + 6 + 6 * SHARP;
            v[c] += of[c] * coarse[k / 4][3 + c] * lobe_scale[d].x + of[3 + c] * coarse[k / 4][6 + c] * lobe_scale[d].y;
#endif
#if ROUGH > 1
            v[c] += of[6 + c] * coarse[k / 4][9 + c] * lobe_scale_2[d].x + of[9 + c] * coarse[k / 4][12 + c] * lobe_scale_2[d].y;
#endif
        }
        put_lanes(outgoing, order, at, d, adds, v);
    }
}

inline float sum_lanes(float16 v)
{
    float8 a = v.lo + v.hi;
    float4 b = a.lo + a.hi;
    return b.x + b.y + b.z + b.w;
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

/* the light that some elements send
 * rows     (r) elements
 * outgoing (N, D, 3)
 * sum      (r): result, over bins and channels
 */
__kernel void sum_of_elements(__global const int *rows, __global const light_t *outgoing, const uint count,
                              __global float *sum)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    __global const light_t *of = outgoing + (size_t)rows[i] * D_BINS * 3;
    float16 all = 0.0f;
    for (int k = 0; k < D_BINS * 3; k += 16) all += fabs(load_light16(of + k));
    sum[i] = sum_lanes(all);
}

/* rows of a light field as they were
 * rows    (r) elements
 * count   r * D
 * before  (N, D, 3); outgoing (N, D, 3): rows are written
 */
__kernel void put_back(__global const int *rows, const uint count, __global const light_t *before,
                       __global light_t *outgoing)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t at = (size_t)rows[i / D_BINS] * D_BINS + i % D_BINS;
    store_light(load_light(before, at), outgoing, at);
}
