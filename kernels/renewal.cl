/* renewal.cl: a light field follows an edit where it changes.  Host: usdslf/light_field/renewal.py.
 */
#include "links.cl"
#include "bin_blocks.cl"

/* the light field takes new rows, one work-item a block of bins of a row
 * rows      (r) elements
 * count     r * BLOCK_COUNT
 * next      (N, D, 3) new radiance
 * outgoing  (N, D, 3) old radiance; becomes the new one
 * change    (N, BLOCK_COUNT): result of those rows, mean difference over the block, summed over channels
 */
__kernel void take_rows(__global const int *rows, const uint count, __global const light_t *next, __global light_t *outgoing,
                        __global float *change)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t e = rows[i / BLOCK_COUNT];
    uint block = i % BLOCK_COUNT;
    float4 sum = 0.0f;
    for (int y = 0; y < BLOCK; y++) {
        size_t at = (e * D_BINS + (block / BLOCKS_ON_SIDE * BLOCK + y) * SIDE + block % BLOCKS_ON_SIDE * BLOCK) * 3;
        for (int k = 0; k < 3 * BLOCK; k += 4) {
            float4 now = load_light4(next + at + k);
            sum += fabs(now - load_light4(outgoing + at + k));
            store_light4(now, outgoing + at + k);
        }
    }
    change[e * BLOCK_COUNT + block] = (sum.x + sum.y + sum.z + sum.w) / (BLOCK * BLOCK);
}

/* how much of a change arrives at each element, weighed by the cosine
 * hit       (N, D) links
 * change    (N, BLOCK_COUNT) of those that did; 0 of others
 * cosine    (D) of sum 1
 * arriving  (N): result, the sum over bins and channels
 */
__kernel void arriving_change(__global const uint *hit, __global const float *change, __global const float *cosine,
                              const uint count, __global float *arriving)
{
    uint e = get_global_id(0);
    if (e >= count) return;
    __global const uint *links = hit + (size_t)e * D_BINS;
    float16 sum = 0.0f;
    for (int d = 0; d < D_BINS; d += 16) {
        float v[16];
        for (int k = 0; k < 16; k++) {
            uint h = links[d + k], of = IS_LINK(h) ? h : 0u;
            float there = IS_LINK(h) ? 1.0f : 0.0f;
            v[k] = there * change[ELEMENT_OF(of) * BLOCK_COUNT + block_of(BIN_OF(of))];
        }
        sum += vload16(0, cosine + d) * vload16(0, v);
    }
    float8 a = sum.lo + sum.hi;
    float4 b = a.lo + a.hi;
    arriving[e] = b.x + b.y + b.z + b.w;
}
