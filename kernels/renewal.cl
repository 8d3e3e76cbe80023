/* renewal.cl: a light field follows an edit where it changes.  Host: usdslf/light_field/renewal.py.
 */
#include "links.cl"
#include "bin_blocks.cl"

#if BLOCK != 4
#error "a row of a block is read as three float4"
#endif

/* the light field takes new rows, one work-item a block of bins of a row
 * rows      (r) elements
 * count     r * BLOCK_COUNT
 * next      (N, D, 3) new radiance
 * outgoing  (N, D, 3) old radiance; becomes the new one
 * change    (1 + r, BLOCK_COUNT) float4: result, rows after the first, means over the block: of red, green, blue, and of
 *           the magnitudes of all three together
 */
__kernel void take_rows(__global const int *rows, const uint count, __global const light_t *next, __global light_t *outgoing,
                        __global float4 *change)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t e = rows[i / BLOCK_COUNT];
    uint block = i % BLOCK_COUNT;
    float4 size = 0.0f, v[3] = {0.0f, 0.0f, 0.0f};
    for (int y = 0; y < BLOCK; y++) {
        size_t at = (e * D_BINS + (block / BLOCKS_ON_SIDE * BLOCK + y) * SIDE + block % BLOCKS_ON_SIDE * BLOCK) * 3;
        for (int k = 0; k < 3; k++) {
            float4 now = load_light4(next + at + 4 * k), moved = now - load_light4(outgoing + at + 4 * k);
            v[k] += moved;
            size += fabs(moved);
            store_light4(now, outgoing + at + 4 * k);
        }
    }
    float4 sum = (float4)(v[0].x + v[0].w + v[1].z + v[2].y, v[0].y + v[1].x + v[1].w + v[2].z,
                          v[0].z + v[1].y + v[2].x + v[2].w, size.x + size.y + size.z + size.w);
    change[BLOCK_COUNT + i] = sum / (BLOCK * BLOCK);
}

/* how much of a change arrives at each element, weighed by the cosine
 * Sixteen links that all name elements which did not change cost no look at the change; of others, those read the same row.
 * hit       (N, D) links
 * row_of    (N) row of change of those that did, 0 of others
 * change    (1 + r, BLOCK_COUNT) float4; the first row is 0
 * cosine    (D) of sum 1
 * arriving  (N) float2: result, sums over channels: what becomes of the irradiance, and the magnitudes of all bins
 */
__kernel void arriving_change(__global const uint *hit, __global const int *row_of, __global const float4 *change,
                              __global const float *cosine, const uint count, __global float2 *arriving)
{
    uint e = get_global_id(0);
    if (e >= count) return;
    __global const uint *links = hit + (size_t)e * D_BINS;
    float16 sum[4];
    for (int c = 0; c < 4; c++) sum[c] = 0.0f;
    for (int d = 0; d < D_BINS; d += 16) {
        int rows[16], some = 0;
        for (int k = 0; k < 16; k++) {
            uint h = links[d + k];
            rows[k] = IS_LINK(h) ? row_of[IS_LINK(h) ? ELEMENT_OF(h) : 0u] : 0;
        }
        for (int k = 0; k < 16; k++) some |= rows[k];
        if (some == 0) continue;
        float v[4][16];
        for (int k = 0; k < 16; k++) {
            float4 met = change[(size_t)rows[k] * BLOCK_COUNT + block_of(BIN_OF(links[d + k]))];
            v[0][k] = met.x; v[1][k] = met.y; v[2][k] = met.z; v[3][k] = met.w;
        }
        float16 weight = vload16(0, cosine + d);
        for (int c = 0; c < 4; c++) sum[c] += weight * vload16(0, v[c]);
    }
    arriving[e] = (float2)(fabs(sum_lanes(sum[0])) + fabs(sum_lanes(sum[1])) + fabs(sum_lanes(sum[2])), sum_lanes(sum[3]));
}
