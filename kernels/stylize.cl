/* stylize.cl: unsharp masking of the surface light field.
 *
 *     M L = max(L + amount (L - B), L / (1 + amount))
 *     B(i, w) = sum_j w_ij <n_j, w>+ L(j, w) / sum_j w_ij <n_j, w>+          j: near elements, w: one direction of the world
 *
 * L is reflected light: what an element emits is taken off.  An eye far off in the direction w sees element j under the area
 * w_ij <n_j, w>+, so B is what a blurred picture of the surroundings shows it; elements that face away from it show nothing, nor
 * do those that something within the radius hides from it, unless element i is so hidden itself.
 * L + amount (L - B) never passes (1 + amount) L, but is below zero beside a light that is bright enough: nothing is to get darker
 * by more than it could get brighter.
 * Light fields are compared on one sphere of bins, the hemisphere of common.cl about the world's z and its mirror image: so that
 * the sums run along memory, and L - B, both read off that sphere, is zero where neighbours look alike.
 *     Nguyen et al. 2013, 7 (of the light field); Ritschel et al. 2008 (over surfaces in space).
 */
#include "common.cl"

/* whether what element j sees in a bin is nearer than a radius */
inline int is_hidden(__global const uint *hit, __global const float *position, uint j, int bin, float radius)
{
    uint h = hit[(size_t)j * D_BINS + bin];
    return h == BLOCKED || (h < BLOCKED && distance(load3(position, h >> 10), load3(position, j)) < radius);
}

/* what an element shows in each bin of half of the sphere
 * frames    (N, 3, 3)
 * emission  (N, 3)
 * outgoing  (N, D, 3)
 * hit       (N, D) packed links; position (N, 3)
 * radius    within which something hides an element; 0: nothing does
 * up        1: the half above, -1: below; count: N
 * shown     (N, 4, D): result, <n, w>+ times L, and <n, w>+
 */
__kernel void show(__global const float *frames, __global const float *emission, __global const float *outgoing,
                   __global const uint *hit, __global const float *position, const float radius, const int up,
                   const uint count, __global float *shown)
{
    uint s = get_global_id(0), j = get_global_id(1);
    if (s >= D_BINS || j >= count) return;
    float3 w = bin_direction(s);
    float3 l = local_from_world(frames, j, (float3)(w.x, w.y, up * w.z));
    int bin = bin_of(l);
    float z = l.z <= 0.0f || (radius > 0.0f && is_hidden(hit, position, j, bin, radius)) ? 0.0f : l.z;
    float3 v = z * (load3(outgoing, (size_t)j * D_BINS + bin) - load3(emission, j));
    __global float *to = shown + (size_t)j * 4 * D_BINS + s;
    to[0] = v.x; to[D_BINS] = v.y; to[2 * D_BINS] = v.z; to[3 * D_BINS] = z;
}

/* L - B of elements in the bins of half of the sphere, sixteen bins at a time
 * first   (N + 1) rows of other and weight
 * other   (K) near elements; weight (K)
 * shown   (N, 4, D)
* detail  (N, 3, D): result, zero where the element faces away
 */
__kernel void take_surroundings(__global const int *first, __global const int *other, __global const float *weight,
                                __global const float *shown, const uint count, __global float *detail)
{
    uint p = get_global_id(0), i = get_global_id(1);
    if (p >= D_BINS / 16 || i >= count) return;
    float16 r = 0.0f, g = 0.0f, b = 0.0f, z = 0.0f;
    for (int k = first[i]; k < first[i + 1]; k++) {
        __global const float *from = shown + (size_t)other[k] * 4 * D_BINS;
        float w = weight[k];
        r += w * vload16(p, from);
        g += w * vload16(p, from + D_BINS);
        b += w * vload16(p, from + 2 * D_BINS);
        z += w * vload16(p, from + 3 * D_BINS);
    }
    __global const float *own = shown + (size_t)i * 4 * D_BINS;
    float16 c = vload16(p, own + 3 * D_BINS);
    int16 is_seen = c > 0.0f && z > 0.0f;
    float16 per_own = 1.0f / select((float16)1.0f, c, is_seen), per_all = 1.0f / select((float16)1.0f, z, is_seen);
    __global float *to = detail + (size_t)i * 3 * D_BINS;
    vstore16(select((float16)0.0f, vload16(p, own) * per_own - r * per_all, is_seen), p, to);
    vstore16(select((float16)0.0f, vload16(p, own + D_BINS) * per_own - g * per_all, is_seen), p, to + D_BINS);
    vstore16(select((float16)0.0f, vload16(p, own + 2 * D_BINS) * per_own - b * per_all, is_seen), p, to + 2 * D_BINS);
}

/* the wanted light of the bins whose directions lie in half of the sphere, and are hidden or not
 * detail    (N, 3, D)
 * hidden    1: bins in which something within the radius hides the element; 0: the others
 * wanted    (N, D, 3): result
 * others as above
 */
__kernel void add_detail(__global const float *frames, __global const float *emission, __global const float *outgoing,
                         __global const uint *hit, __global const float *position, const float radius, const int up,
                         const uint count, __global const float *detail, const float amount, const int hidden,
                         __global float *wanted)
{
    uint d = get_global_id(0), i = get_global_id(1);
    if (d >= D_BINS || i >= count) return;
    float3 w = world_from_local(frames, i, bin_direction(d));
    if ((w.z < 0.0f) != (up < 0) || is_hidden(hit, position, i, d, radius) != hidden) return;
    int s = bin_of((float3)(w.x, w.y, fabs(w.z)));
    size_t at = (size_t)i * D_BINS + d;
    __global const float *more = detail + (size_t)i * 3 * D_BINS + s;
    float3 light = load3(outgoing, at) - load3(emission, i);
    float3 sharp = light + amount * (float3)(more[0], more[D_BINS], more[2 * D_BINS]);
    store3(max(sharp, light / (1.0f + amount)), wanted, at);
}

/* how far the reflected light of each element is from what is wanted
 * emission  (N, 3); outgoing, wanted (N, D, 3)
 * misfit    (N): result, squares summed over bins and channels
 */
__kernel void misfit(__global const float *emission, __global const float *outgoing, __global const float *wanted,
                     const uint count, __global float *misfit)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    float3 e = load3(emission, i), sum = (float3)(0.0f);
    for (size_t at = (size_t)i * D_BINS; at < (size_t)(i + 1) * D_BINS; at++) {
        float3 apart = load3(outgoing, at) - e - load3(wanted, at);
        sum += apart * apart;
    }
    misfit[i] = sum.x + sum.y + sum.z;
}

/* light without a part of it
 * all, part, rest (size): rest is the result
 */
__kernel void take_off(__global const float *all, __global const float *part, const ulong size, __global float *rest)
{
    size_t i = get_global_id(0);
    if (i < size) rest[i] = all[i] - part[i];
}
