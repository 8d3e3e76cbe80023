/* live_camera.cl: rays of a camera, and the lights that it sees; device twin of scene/cameras.py. */
#include "live_sources.cl"

/* rays through places (x, y) of a picture, in pixels from its top left
 * camera (25): eye, axes x y z of the camera, film left, right, bottom, top, focal length (0: orthographic), near, far, width, height
 * of the picture; x, y and width of a window; samples on a side of a pixel
 * at (n, 2), or, without `has_places`, the middles of the window's pixels */
__kernel void camera_rays(
    const uint count, __global const float *camera, const int has_places, __global const float *at,
    __global float *origin, __global float *direction, __global float *length_of)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    uint width = has_places ? 1u : (uint)camera[23], row = (uint)i / width;
    int column_of = (int)((uint)i - row * width) + (int)camera[21], row_of = (int)row + (int)camera[22], a = (int)camera[24];
    float px = has_places ? at[2 * i] : column_of + (row_of % a + 0.5f) / a;
    float py = has_places ? at[2 * i + 1] : row_of + (a - 1 - column_of % a + 0.5f) / a;
    float x = camera[12] + px / camera[19] * (camera[13] - camera[12]), y = camera[15] + py / camera[20] * (camera[14] - camera[15]);
    float3 eye = row3(camera, 0), ax = row3(camera, 3), ay = row3(camera, 6), az = row3(camera, 9);
    float focal = camera[16], per_depth = 1.0f;
    float3 d = -az, from = eye;
    if (focal > 0.0f) {
        float l = sqrt(x * x + y * y + focal * focal);
        per_depth = l / focal;
        d = (x * ax + y * ay - focal * az) / l;
    } else {
        from += x * ax + y * ay;
    }
    float skipped = per_depth * camera[17];
    store3(from + skipped * d, origin, i);
    store3(d, direction, i);
    length_of[i] = lesser(per_depth * camera[18] - skipped, 1e37f);
}

/* lights and domes in view: what hides a hit takes it away; backdrop (n, 3)
 * length_of (n): how far rays look */
__kernel void lights_in_view(
    const uint count, SCENE_PARAMETERS, __global const float *origin, __global const float *direction,
    __global const float *length_of, __global int *triangle, __global const float *distance, __global float *backdrop)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    float3 p = load3(origin, i), d = load3(direction, i), seen = (float3)(0.0f);
    float far = length_of[i] < 1e36f ? length_of[i] : INFINITY;
    float limit = triangle[i] >= 0 ? lesser(distance[i], far) : far, nearest = INFINITY;
    int in_light = 0;
    for (int s = 0; s < source_count; s++) {
        __global const float *source = sources + s * SOURCE;
        int kind = (int)source[SRC_KIND];
        if (kind > DISTANT || (kind == DISTANT && !(source[SRC_SIZE] > 0.0f))) continue;
        Arrival a = meet_source(source, pictures, p, d, kind == DISTANT ? limit : lesser(limit, nearest));
        if (!(a.density > 0.0f) || (kind == DISTANT && in_light) || !(largest(a.radiance) > 0.0f)) continue;
        nearest = a.distance;
        seen = a.radiance;
        in_light = 1;
    }
    if (in_light)
        triangle[i] = -1;
    else if (triangle[i] < 0)
        for (int s = 0; s < source_count; s++)
            if ((int)sources[s * SOURCE + SRC_KIND] == DOME) seen += dome_radiance(sources + s * SOURCE, pictures, d);
    store3(seen, backdrop, i);
}
