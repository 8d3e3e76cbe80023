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
