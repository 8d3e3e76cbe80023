/* guided_directions.cl: directions drawn from the light at an element, and their density: see usdslf/render/guide.py.
 *
 * Within a block directions are even.
 */
#include "bin_blocks.cl"

inline float guide_density(__global const float *row, __global const float *frames, int element, float3 d)
{
    float3 l = local_from_world(frames, element, d);
    if (l.z <= 0.0f) return 0.0f;
    int bin = bin_of(l);
    int b = block_of(bin);
    float chance = row[b] - chance_before(row, b);
    return chance * BLOCK_COUNT / (2.0f * PI_F);
}

inline float3 guided_direction(__global const float *row, __global const float *frames, int element, float2 u)
{
    int low = block_by_chance(row, u.x);
    float before = chance_before(row, low);
    float x = clamp((u.x - before) / max(row[low] - before, 1e-12f), 0.0f, 0.9999999f);
    float2 q = ((float2)(low % BLOCKS_ON_SIDE + x, low / BLOCKS_ON_SIDE + u.y)) * (2.0f / BLOCKS_ON_SIDE) - 1.0f;
    return world_from_local(frames, element, hemisphere_from_square(q.x, q.y));
}
