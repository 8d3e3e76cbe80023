/* guide.cl: the light that arrives at elements by blocks of bins, from which rays are guided: see usdslf/render/guide.py. */
#include "bin_blocks.cl"
#include "links.cl"

/* luminance times cosine that arrives at each block of an element: from surfaces, their own emission left out (it is
 * sampled as light); the cosine-weighted share of the block that escapes; and all of the light */
__kernel void guiding_light(
    const uint count,                 /* N * blocks */
    __global const uint *hit,         /* (N, D) links */
    __global const float *mean,       /* (N, D / BLOCK^2, 3) outgoing, of average_bins */
    __global const light_t *fixed,    /* (N, D, 3) light that arrives from lights and domes */
    __global const float *emitted,    /* (N) luminance */
    __global float *light)            /* (N, blocks, 3) out */
{
    uint i = get_global_id(0);
    if (i >= count) return;
    size_t element = i / BLOCK_COUNT;
    uint b = i % BLOCK_COUNT;
    float sum = 0.0f, open = 0.0f, all = 0.0f;
    for (uint y = 0; y < BLOCK; y++)
        for (uint x = 0; x < BLOCK; x++) {
            int d = bin_in_block(b, x, y);
            float r = max(fabs((float)(d % SIDE) - 0.5f * (SIDE - 1)), fabs((float)(d / SIDE) - 0.5f * (SIDE - 1))) * (2.0f / SIDE);
            float z = 1.0f - r * r; /* of bin_direction(d) */
            uint h = hit[element * D_BINS + d];
            all += dot(load_light(fixed, element * D_BINS + d), LUMINANCE) * z;
            if (h == ESCAPES) open += z;
            if (!IS_LINK(h)) continue;
            uint bin = BIN_OF(h);
            uint to = block_of(bin);
            float l = dot(load3(mean, (size_t)ELEMENT_OF(h) * BLOCK_COUNT + to), LUMINANCE);
            sum += max(l - emitted[ELEMENT_OF(h)], 0.0f) * z;
            all += l * z;
        }
    store3((float3)(sum, open, all), light, i);
}
