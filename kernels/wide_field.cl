/* wide_field.cl: the light field for wide rays, averaged over blocks of bins: see usdslf/render/wide_field.py. */
#include "bin_blocks.cl"
#include "links.cl"

__kernel void average_bins(
    const uint count,                 /* N * blocks */
    __global const light_t *outgoing, /* (N, D, 3) */
    __global float *mean)             /* (N, D / BLOCK^2, 3) out */
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t element = i / BLOCK_COUNT;
    uint b = i % BLOCK_COUNT;
    float3 sum = (float3)(0.0f);
    for (uint y = 0; y < BLOCK; y++)
        for (uint x = 0; x < BLOCK; x++)
            sum += load_light(outgoing, element * D_BINS + bin_in_block(b, x, y));
    store3(sum / (float)(BLOCK * BLOCK), mean, i);
}

__kernel void follow_wide_links(
    const uint n,                   /* hits */
    const uint near,                /* links of each */
    __global const uint *links,     /* (n, near) links */
    __global const float *weights,  /* (n, near) */
    __global const float *mean,     /* (N, D / BLOCK^2, 3) */
    __global float *radiance)       /* (n, 4) out: interpolated, and the luminance of the brightest element */
{
    uint i = get_global_id(0);
    if (i >= n) return;
    float3 v = (float3)(0.0f);
    float brightest = 0.0f;
    for (uint k = 0; k < near; k++) {
        uint h = links[i * near + k];
        if (!IS_LINK(h)) continue;
        uint bin = BIN_OF(h);
        uint b = block_of(bin);
        float3 one = load3(mean, (size_t)ELEMENT_OF(h) * BLOCK_COUNT + b);
        float weight = weights[i * near + k];
        v += weight * one;
        if (weight > 0.02f) brightest = max(brightest, dot(one, LUMINANCE));
    }
    vstore4((float4)(v, brightest), i, radiance);
}
