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

inline int coarse_of_bin(int d) { return (d / SIDE / 2) * (SIDE / 2) + (d % SIDE) / 2; }

/* light arriving at a block's elements: fixed light plus what the elements that they see send back
 * order     (blocks * 16) element of each lane, -1 for none
 * hit       (N, D) packed links
 * fixed     (N, D, 3) light that no edit changes
 * outgoing  (N, D, 3)
 * light     (blocks, D, 3) float16: result
 */
__kernel void gather(__global const int *order, __global const uint *hit, __global const float *fixed,
                     __global const float *outgoing, const int first_block, __global float *light)
{
    int d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS) return;
    float r[LANES], g[LANES], b[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[(first_block + block) * LANES + lane];
        float3 v = (float3)(0.0f);
        if (e >= 0) {
            size_t at = (size_t)e * D_BINS + d;
            uint h = hit[at];
            v = load3(fixed, at);
            if (IS_LINK(h)) v += load3(outgoing, h);
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

inline void add_to(__global float *outgoing, __global const int *order, int at, int d, const float16 *v)
{
    float rgb[3][LANES];
    for (int c = 0; c < 3; c++) vstore16(v[c], 0, rgb[c]);
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[at + lane];
        if (e < 0) continue;
        size_t to = ((size_t)e * D_BINS + d) * 3;
        for (int c = 0; c < 3; c++) outgoing[to + c] += rgb[c][lane];
    }
}

/* diffuse reflection, and with LOBE a rough lobe too, on the 16 x 16 bins
 * coarse      (blocks, Q, 3) float16
 * e_pi        (blocks, 3) float16
 * y, a, b     (Q, Q) rows are outgoing bins
 * y_scale     (D); lobe_scale (D, 2): coarse to fine albedo
 * parameters  (blocks, 12) float16: dx, dy, F0, F90, each of three channels
 * outgoing    (N, D, 3): added to
 */
__kernel void reflect_coarse(__global const float16 *coarse, __global const float16 *e_pi, __global const float *y,
                             __global const float *a, __global const float *b, __global const float *y_scale,
                             __global const float2 *lobe_scale, __global const float16 *parameters,
                             __global const int *order, const int first_block, __global float *outgoing)
{
    int q = get_global_id(0), block = get_global_id(1);
    if (q >= Q_BINS) return;
    __global const float16 *light = coarse + (size_t)block * Q_BINS * 3;
    float16 ys[3] = {0.0f, 0.0f, 0.0f};
#if LOBE
    float16 as[3] = {0.0f, 0.0f, 0.0f}, bs[3] = {0.0f, 0.0f, 0.0f};
#endif
    for (int k = 0; k < Q_BINS; k++) {
        float wy = y[q * Q_BINS + k];
        float16 r = light[k * 3], g = light[k * 3 + 1], bl = light[k * 3 + 2];
        ys[0] += wy * r; ys[1] += wy * g; ys[2] += wy * bl;
#if LOBE
        float wa = a[q * Q_BINS + k], wb = b[q * Q_BINS + k];
        as[0] += wa * r; as[1] += wa * g; as[2] += wa * bl;
        bs[0] += wb * r; bs[1] += wb * g; bs[2] += wb * bl;
#endif
    }
    __global const float16 *p = parameters + (size_t)(first_block + block) * 12;
    for (int k = 0; k < 4; k++) {
        int d = ((q / (SIDE / 2)) * 2 + k / 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2;
        float16 v[3];
        for (int c = 0; c < 3; c++) {
            float16 yv = ys[c] * y_scale[d];
            v[c] = p[c] * (e_pi[block * 3 + c] - yv) + p[3 + c] * yv;
#if LOBE
            v[c] += p[6 + c] * as[c] * lobe_scale[d].x + p[9 + c] * bs[c] * lobe_scale[d].y;
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
                            __global const int *order, const int first_block, __global float *outgoing)
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

/* every bin of an element starts from what it emits
 * emission (N, 3); outgoing (N, D, 3): result; count = N * D
 */
__kernel void emit(__global const float *emission, const uint count, __global float *outgoing)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    store3(load3(emission, i / D_BINS), outgoing, i);
}

/* how far two light fields are apart, element by element
 * old, now   (N, D, 3)
 * difference (N, 2): sums of |now - old| and of |now|
 */
__kernel void difference(__global const float *old, __global const float *now, const uint count, __global float *difference)
{
    uint e = get_global_id(0);
    if (e >= count) return;
    size_t at = (size_t)e * D_BINS * 3;
    float apart = 0.0f, all = 0.0f;
    for (int k = 0; k < D_BINS * 3; k++) {
        apart += fabs(now[at + k] - old[at + k]);
        all += fabs(now[at + k]);
    }
    difference[2 * e] = apart;
    difference[2 * e + 1] = all;
}
