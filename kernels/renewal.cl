/* renewal.cl: a light field follows an edit where it changes.  Host: usdslf/light_field/renewal.py.
 */
#include "links.cl"

/* the bins of some elements start from what they emit
 * rows     (r) elements
 * emission (N, 3)
 * count    r * D
 * next     (N, D, 3): rows are written
 */
__kernel void emit_rows(__global const int *rows, __global const float *emission, const uint count, __global light_t *next)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    uint e = rows[i / D_BINS];
    store_light(load3(emission, e), next, (size_t)e * D_BINS + i % D_BINS);
}

/* the light field takes new rows, and the rows keep how far they are from the old ones
 * rows      (count) elements
 * next      (N, D, 3) new radiance; becomes new - old
 * outgoing  (N, D, 3) old radiance; becomes the new one
 */
__kernel void take_rows(__global const int *rows, const uint count, __global light_t *next, __global light_t *outgoing)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t at = (size_t)rows[i] * D_BINS * 3;
    for (int k = 0; k < D_BINS * 3; k += 16) {
        float16 now = load_light16(next + at + k), before = load_light16(outgoing + at + k);
        store_light16(now, outgoing + at + k);
        store_light16(now - before, next + at + k);
    }
}

/* how much of a change arrives at each element, weighed by the cosine
 * hit       (N, D) links
 * is_new    (N) whether an element changed
 * change    (N, D, 3) of those that did
 * cosine    (D) of sum 1
 * arriving  (N): result, the sum over bins and channels
 */
__kernel void arriving_change(__global const uint *hit, __global const int *is_new, __global const light_t *change,
                              __global const float *cosine, const uint count, __global float *arriving)
{
    uint e = get_global_id(0);
    if (e >= count) return;
    __global const uint *links = hit + (size_t)e * D_BINS;
    float sum = 0.0f;
    for (int d = 0; d < D_BINS; d++) {
        uint h = links[d];
        if (!IS_LINK(h) || !is_new[ELEMENT_OF(h)]) continue;
        float3 v = fabs(load_light(change, h));
        sum += cosine[d] * (v.x + v.y + v.z);
    }
    arriving[e] = sum;
}
