/* live_field.cl: what the live picture takes from the light field beforehand: see usdslf/render/live/scene.py. */
#include "links.cl"

/* indirect irradiance over pi of each element; what elements emit is left out, it is sampled as light
 * hit (N, D) links; outgoing (N, D, 3); emission (N, 3); cosine (D) scaled to the sum 1; soft (N, 3) result */
__kernel void soft_irradiance(
    const uint count, __global const uint *hit, __global const light_t *outgoing, __global const float *emission,
    __global const float *cosine, __global float *soft)
{
    size_t e = get_global_id(0);
    if (e >= count) return;
    float3 sum = (float3)(0.0f);
    for (int d = 0; d < D_BINS; d++) {
        uint h = hit[e * D_BINS + d];
        if (IS_LINK(h)) sum += cosine[d] * max(load_light(outgoing, h) - load3(emission, ELEMENT_OF(h)), 0.0f);
    }
    store3(sum, soft, e);
}
