/* light_field.cl: one bounce, L_o = L_e + K (L_fixed + G L_o), for blocks of sixteen elements of one roughness level.
 *
 * The matrices K are the same for all elements, so sixteen elements ride in the lanes of a float16: a weight is read once and
 * used sixteen times.  Arrays of a block are [bin][channel][lane].
 *     L_o = dx (E/pi - Y) + dy Y + F0 A + F90 B          dx = d (1 - F0), dy = d (1 - F90)
 * Nguyen et al. 2013, 5.2 and 6.2.
 */
#include "links.cl"
#include "symmetry.cl"

#define LANES 16
#define Q_BINS (D_BINS / 4)
#ifndef STREAMED
#define STREAMED 0
#endif

/* light arriving at a block's elements in two rows of bins: fixed light plus what the elements that they see send back
 * Lane after lane, as an element's bins lie side by side, and those of the others a multiple of a page away.  Without branches, so
 * that many reads are under way at once; lanes of none and bins of no link read the first bin, times zero.
 * elements  (LANES) of each lane, -1 for none; row: of the block's first lane in hit and fixed, with STREAMED
 * rows      (ROWS, 3) by lane: result
 */
#define ROWS (2 * SIDE)
inline void gather_rows(__global const int *elements, const size_t row, __global const uint *hit, __global const light_t *fixed,
                        __global const light_t *outgoing, const int first_bin, float (*rows)[LANES])
{
    for (int lane = 0; lane < LANES; lane++) {
        int e = elements[lane];
        size_t at = (STREAMED ? row + lane : (size_t)(e >= 0 ? e : 0)) * D_BINS + first_bin;
        __global const uint *links = hit + at;
        __global const light_t *own = fixed + 3 * at;
        float there = e >= 0 ? 1.0f : 0.0f;
        for (int k = 0; k < ROWS; k++) {
            uint h = links[k];
            float share = IS_LINK(h) ? there : 0.0f;
            __global const light_t *sent = outgoing + 3 * (size_t)(IS_LINK(h) ? h : 0u);
            for (int c = 0; c < 3; c++) rows[3 * k + c][lane] = there * light_at(own, 3 * k + c) + share * light_at(sent, c);
        }
    }
}

/* light arriving at a block's elements; one work-item two rows of bins of a block
 * order     (blocks * 16) element of each lane, -1 for none
 * hit       (N, D) packed links
 * fixed     (N, D, 3) light that no edit changes; with STREAMED it and hit are of the lanes of these blocks: (blocks * 16, D)
 * outgoing  (N, D, 3)
 * light     (blocks, D, 3) float16: result
 */
__kernel void gather(__global const int *order, __global const uint *hit, __global const light_t *fixed,
                     __global const light_t *outgoing, const int first_block, __global float16 *light)
{
    int first = get_global_id(0) * ROWS, block = get_global_id(1);
    if (first >= D_BINS) return;
    float rows[ROWS * 3][LANES];
    gather_rows(order + (first_block + block) * LANES, (size_t)block * LANES, hit, fixed, outgoing, first, rows);
    __global float16 *to = light + ((size_t)block * D_BINS + first) * 3;
    for (int k = 0; k < ROWS * 3; k++) to[k] = vload16(0, rows[k]);
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

/* lobes of a block, two where its elements lie between two levels: rough ones in coarse bins, sharp ones in fine bins */
#ifndef ROUGH
#define ROUGH 0
#endif
#ifndef SHARP
#define SHARP 0
#endif
#define COLUMNS (1 + 2 * ROUGH)              /* Y, and A, B of each rough lobe */
#define PARAMETERS (6 + 6 * (ROUGH + SHARP)) /* dx, dy, then F0, F90 of the share of each lobe, sharp ones first */

/* light arriving at a block's elements, in the basis but for the swap; one work-item a row of cells
 * cosine    (D) cosines of the bins, scaled to the sum 1
 * folded    (blocks, Q, 3) float16: result, of those that are odd under one flip
 * cells     (blocks, 2, CELLS, 3) float16: result, even under both flips and odd under both
 * e_part    (blocks, H, 3) float16: result, parts of the irradiance over pi
 * light     (blocks, D, 3) float16: result, where there are sharp lobes
 * others as of gather
 */
__kernel void gather_folded(__global const int *order, __global const uint *hit, __global const light_t *fixed,
                            __global const light_t *outgoing, __global const float *cosine, const int first_block,
                            __global float16 *folded, __global float16 *cells, __global float16 *e_part, __global float16 *light)
{
    int y = get_global_id(0), block = get_global_id(1);
    if (y >= H) return;
    float16 coarse[2][SIDE / 2 * 3], e_pi[3];
    for (int c = 0; c < 3; c++) e_pi[c] = 0.0f;
    for (int low = 0; low < 2; low++) {
        int first = fine_bin(folded_bin(y, 0, low, 0), 0);
        float rows[ROWS * 3][LANES];
        gather_rows(order + (first_block + block) * LANES, (size_t)block * LANES, hit, fixed, outgoing, first, rows);
        for (int q = 0; q < SIDE / 2; q++)
            for (int c = 0; c < 3; c++) {
                float16 sum = 0.0f;
                for (int m = 0; m < 4; m++) {
                    int k = m / 2 * SIDE + 2 * q + m % 2;
                    float16 a = vload16(0, rows[3 * k + c]);
                    sum += a;
                    e_pi[c] += cosine[first + k] * a;
#if SHARP
                    light[((size_t)block * D_BINS + first + k) * 3 + c] = a;
#endif
                }
                coarse[low][q * 3 + c] = 0.25f * sum;
            }
    }
    for (int c = 0; c < 3; c++) e_part[((size_t)block * H + y) * 3 + c] = e_pi[c];
    __global float16 *to = folded + (size_t)block * Q_BINS * 3, *cell = cells + ((size_t)block * 2 * CELLS + y * H) * 3;
    for (int x = 0; x < H; x++)
        for (int c = 0; c < 3; c++) {
            float16 a = coarse[0][x * 3 + c], b = coarse[0][(2 * H - 1 - x) * 3 + c];
            float16 d = coarse[1][x * 3 + c], f = coarse[1][(2 * H - 1 - x) * 3 + c];
            to[(EVEN_ODD + y * H + x) * 3 + c] = a + d - b - f;
            to[(ODD_EVEN + x * H + y) * 3 + c] = a + b - d - f;
            cell[x * 3 + c] = a + b + d + f;
            cell[(CELLS + x) * 3 + c] = a - b - d + f;
        }
}

/* the swap: sums and differences of cells and those across the diagonal; one work-item a pair
 * cells, folded  of gather_folded; the rest of the latter: result
 */
__kernel void fold_swapped(__global const float16 *cells, __global float16 *folded)
{
    int item = get_global_id(0), block = get_global_id(1);
    if (item >= ALIKE) return;
    int y = 0, x = item;
    while (x >= H - y) { x -= H - y; y++; }
    x += y;
    __global float16 *to = folded + (size_t)block * Q_BINS * 3;
    for (int odd = 0; odd < 2; odd++)
        for (int c = 0; c < 3; c++) {
            __global const float16 *cell = cells + ((size_t)block * 2 + odd) * CELLS * 3 + c;
            float16 a = cell[(y * H + x) * 3], b = cell[(x * H + y) * 3];
            to[(odd * ODD + item) * 3 + c] = y < x ? a + b : a;
            if (y < x) to[(odd * ODD + ALIKE + opposite_of(y, x)) * 3 + c] = a - b;
        }
}

/* rows of the basis that a work-item makes: as many sums as stay in registers */
#define TOGETHER (ROUGH == 0 ? 4 : ROUGH == 1 ? 2 : 1)

/* the columns Y, and A and B of rough lobes, in the basis; blocks of the matrices have a multiple of TOGETHER rows
 * folded   (blocks, Q, 3) float16
 * y, a, b  blocks of the matrices one after another, row by row; a_2, b_2 of the second rough lobe
 * e_part   (blocks, H, 3) float16; e_pi (blocks, 3) float16: result, their sum, the irradiance over pi
 * answer   (blocks, Q, COLUMNS, 3) float16: result
 */
__kernel void reflect_folded(__global const float16 *folded, __global const float *y, __global const float *a,
                             __global const float *b, __global const float *a_2, __global const float *b_2,
                             __global const float16 *e_part, __global float16 *e_pi, __global float16 *answer)
{
    int item = get_global_id(0), q = item * TOGETHER, block = get_global_id(1);
    if (item < 3) {
        float16 all = 0.0f;
        for (int k = 0; k < H; k++) all += e_part[((size_t)block * H + k) * 3 + item];
        e_pi[block * 3 + item] = all;
    }
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
    float16 sum[TOGETHER][COLUMNS][3];
#pragma unroll
    for (int i = 0; i < TOGETHER; i++)
#pragma unroll
        for (int n = 0; n < COLUMNS; n++) sum[i][n][0] = sum[i][n][1] = sum[i][n][2] = 0.0f;
    for (int k = 0; k < size; k++) {
        float16 r[3] = {light[k * 3], light[k * 3 + 1], light[k * 3 + 2]};
#pragma unroll
        for (int i = 0; i < TOGETHER; i++) {
            int at = matrix + i * size + k;
            float w[COLUMNS];
            w[0] = y[at];
#if ROUGH
            w[1] = a[at]; w[2] = b[at];
#endif
#if ROUGH > 1
            w[3] = a_2[at]; w[4] = b_2[at];
#endif
#pragma unroll
            for (int n = 0; n < COLUMNS; n++) {
                sum[i][n][0] += w[n] * r[0];
                sum[i][n][1] += w[n] * r[1];
                sum[i][n][2] += w[n] * r[2];
            }
        }
    }
    __global float16 *to = answer + ((size_t)block * Q_BINS + q) * COLUMNS * 3;
#pragma unroll
    for (int i = 0; i < TOGETHER; i++)
#pragma unroll
        for (int n = 0; n < COLUMNS; n++) {
            to[(i * COLUMNS + n) * 3] = sum[i][n][0];
            to[(i * COLUMNS + n) * 3 + 1] = sum[i][n][1];
            to[(i * COLUMNS + n) * 3 + 2] = sum[i][n][2];
        }
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

/* what elements send out, from the basis to the bins; one work-item a row of cells, in two fine rows of bins above and two below
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
    int y = get_global_id(0), block = get_global_id(1);
    if (y >= H) return;
    int at = (first_block + block) * LANES;
    __global const float16 *from = answer + (size_t)block * Q_BINS * COLUMNS * 3;
    __global const float16 *p = parameters + (size_t)(first_block + block) * PARAMETERS;
    float glow[3][LANES];
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[at + lane];
        float3 g = adds || e < 0 ? (float3)(0.0f) : load3(emission, e);
        glow[0][lane] = g.x; glow[1][lane] = g.y; glow[2][lane] = g.z;
    }
    for (int low = 0; low < 2; low++) {
        float rows[ROWS * 3][LANES];
        for (int x = 0; x < H; x++) {
            int low_y = min(y, x), high_x = max(y, x);
            int alike = alike_of(low_y, high_x), opposite = ALIKE + (y == x ? 0 : opposite_of(low_y, high_x));
            float sign = y < x ? 1.0f : y > x ? -1.0f : 0.0f;
            float16 coarse[2][COLUMNS * 3]; /* left or not, as folded_bin */
            for (int c = 0; c < COLUMNS * 3; c++) {
                float16 even = from[alike * COLUMNS * 3 + c] + sign * from[opposite * COLUMNS * 3 + c];
                float16 odd = from[(ODD + alike) * COLUMNS * 3 + c] + sign * from[(ODD + opposite) * COLUMNS * 3 + c];
                float16 across = from[(EVEN_ODD + y * H + x) * COLUMNS * 3 + c];
                float16 down = from[(ODD_EVEN + x * H + y) * COLUMNS * 3 + c];
                float16 same = low ? even - down : even + down, other = low ? across - odd : across + odd;
                coarse[0][c] = same + other;
                coarse[1][c] = same - other;
            }
            for (int k = 0; k < 8; k++) {
                int d = fine_bin(folded_bin(y, x, low, k / 4), k % 4);
                float16 *of_bin = coarse[k / 4];
                for (int c = 0; c < 3; c++) {
                    float16 yv = of_bin[c] * y_scale[d];
                    float16 v = vload16(0, glow[c]) + p[c] * (e_pi[block * 3 + c] - yv) + p[3 + c] * yv;
#if SHARP
                    v += sharp[((size_t)block * D_BINS + d) * 3 + c];
#endif
#if ROUGH
                    __global const float16 *of = p + 6 + 6 * SHARP;
                    v += of[c] * of_bin[3 + c] * lobe_scale[d].x + of[3 + c] * of_bin[6 + c] * lobe_scale[d].y;
#endif
#if ROUGH > 1
                    v += of[6 + c] * of_bin[9 + c] * lobe_scale_2[d].x + of[9 + c] * of_bin[12 + c] * lobe_scale_2[d].y;
#endif
                    vstore16(v, 0, rows[(k % 4 / 2 * SIDE + d % SIDE) * 3 + c]);
                }
            }
        }
        /* lane after lane, as in gather_rows */
        int first = fine_bin(folded_bin(y, 0, low, 0), 0);
        for (int lane = 0; lane < LANES; lane++) {
            int e = order[at + lane];
            if (e < 0) continue;
            __global light_t *to = outgoing + ((size_t)e * D_BINS + first) * 3;
            for (int k = 0; k < ROWS * 3; k += 4) {
                float4 v = (float4)(rows[k][lane], rows[k + 1][lane], rows[k + 2][lane], rows[k + 3][lane]);
                if (adds) v += load_light4(to + k);
                store_light4(v, to + k);
            }
        }
    }
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
