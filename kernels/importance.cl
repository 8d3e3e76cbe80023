/* importance.cl: how much elements matter to who sees what others reflect of them.  Host: usdslf/light_field/importance.py.
 */
#include "links.cl"

/* the mean by cosine, over the bins of each element, of a number that those have which it sees
 * hit     (N, D) links
 * value   (N)
 * cosine  (D) of sum 1
 * mean    (N): result
 */
__kernel void mean_of_seen(__global const uint *hit, __global const float *value, __global const float *cosine,
                           const uint count, __global float *mean)
{
    uint e = get_global_id(0);
    if (e >= count) return;
    __global const uint *links = hit + (size_t)e * D_BINS;
    float16 sum = 0.0f;
    for (int d = 0; d < D_BINS; d += 16) {
        float met[16];
        for (int k = 0; k < 16; k++) {
            uint h = links[d + k];
            met[k] = IS_LINK(h) ? value[IS_LINK(h) ? ELEMENT_OF(h) : 0u] : 0.0f;
        }
        sum += vload16(0, cosine + d) * vload16(0, met);
    }
    float8 a = sum.lo + sum.hi;
    float4 b = a.lo + a.hi;
    mean[e] = b.x + b.y + b.z + b.w;
}
