/* unsharp_mask.cl: unsharp masking of the surface light field.
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
#include "links.cl"

/* whether what element j sees in a bin is nearer than a radius */
inline int is_hidden(__global const uint *hit, __global const float *position, uint j, int bin, float radius)
{
    uint h = hit[(size_t)j * D_BINS + bin];
    return h == BLOCKED || (IS_LINK(h) && distance(load3(position, ELEMENT_OF(h)), load3(position, j)) < radius);
}

/* where on the sphere each bin of an element lies, and in which of four passes it is masked
 * frames     (N, 3, 3); directions (D, 3) of the bins
 * hit        (N, D) packed links; position (N, 3)
 * radius     within which something hides an element
 * place      (N, D): result, bin of half of the sphere + D * pass; pass 1 for the half below, + 2 where it is hidden
 */
__kernel void place_bins(__global const float *frames, __global const float *directions, __global const uint *hit,
                         __global const float *position, const float radius, const uint count, __global ushort *place)
{
    uint d = get_global_id(0), i = get_global_id(1);
    if (d >= D_BINS || i >= count) return;
    float3 w = world_from_local(frames, i, load3(directions, d));
    int pass = (w.z < 0.0f) + 2 * is_hidden(hit, position, i, d, radius);
    place[(size_t)i * D_BINS + d] = bin_of((float3)(w.x, w.y, fabs(w.z))) + D_BINS * pass;
}

/* which bin of an element each bin of half of the sphere is
 * up    1: the half above, -1: below
 * bins  (N, D): result, negative where the element faces away
 */
__kernel void turn_bins(__global const float *frames, __global const float *directions, const int up, const uint count,
                        __global short *bins)
{
    uint s = get_global_id(0), j = get_global_id(1);
    if (s >= D_BINS || j >= count) return;
    float3 w = load3(directions, s);
    float3 l = local_from_world(frames, j, (float3)(w.x, w.y, up * w.z));
    bins[(size_t)j * D_BINS + s] = l.z > 0.0f ? bin_of(l) : -1;
}

/* what an element shows in each bin of half of the sphere
 * emission  (N, 3)
 * outgoing  (N, D, 3)
 * hidden    1: nothing hides it; count: N
 * shown     (D / 16, N, 4, 16): result, <n, w>+ times L, and <n, w>+
 */
__kernel void show(__global const short *bins, __global const float *frames, __global const float *directions,
                   const int up, __global const float *emission, __global const light_t *outgoing,
                   __global const uint *hit, __global const float *position, const float radius, const int hidden,
                   const uint count, __global float *shown)
{
    uint s = get_global_id(0), j = get_global_id(1);
    if (s >= D_BINS || j >= count) return;
    int bin = bins[(size_t)j * D_BINS + s];
    float4 v = 0.0f;
    if (bin >= 0 && (hidden || !is_hidden(hit, position, j, bin, radius))) {
        float3 w = load3(directions, s);
        float z = dot(load3(frames, 3 * j + 2), (float3)(w.x, w.y, up * w.z));
        v = (float4)(z * (load_light(outgoing, (size_t)j * D_BINS + bin) - load3(emission, j)), z);
    }
    __global float *to = shown + ((size_t)(s / 16) * count + j) * 4 * 16 + s % 16;
    to[0] = v.x; to[16] = v.y; to[32] = v.z; to[48] = v.w;
}

/* which sixteen bins of half of the sphere any bin of an element lies in, in a pass
 * asked  (D / 16, N): 1 is written where one does
 */
__kernel void ask(__global const ushort *place, const int pass, const uint count, __global int *asked)
{
    uint d = get_global_id(0), i = get_global_id(1);
    if (d >= D_BINS || i >= count) return;
    int s = place[(size_t)i * D_BINS + d] - D_BINS * pass;
    if (s >= 0 && s < D_BINS) asked[(size_t)(s / 16) * count + i] = 1;
}

/* L - B of elements where it is asked for, sixteen bins at a time, those of all elements before the next: what they
 * show in these stays in the caches
 * first   (N + 1) rows of other and weight
 * other   (K) near elements; weight (K)
 * detail  (D / 16, N, 3) float16: result, zero where the element faces away
 */
__kernel void take_surroundings(__global const int *first, __global const int *other, __global const float *weight,
                                __global const float16 *shown, __global const int *asked, const uint count,
                                __global float16 *detail)
{
    uint i = get_global_id(0), p = get_global_id(1);
    if (i >= count || p >= D_BINS / 16) return;
    size_t at = (size_t)p * count + i;
    if (!asked[at]) return;
    float16 r = 0.0f, g = 0.0f, b = 0.0f, z = 0.0f;
    for (int k = first[i]; k < first[i + 1]; k++) {
        __global const float16 *from = shown + ((size_t)p * count + other[k]) * 4;
        float w = weight[k];
        r += w * from[0];
        g += w * from[1];
        b += w * from[2];
        z += w * from[3];
    }
    __global const float16 *own = shown + at * 4;
    float16 c = own[3];
    int16 is_seen = c > 0.0f && z > 0.0f;
    float16 per_own = 1.0f / select((float16)1.0f, c, is_seen), per_all = 1.0f / select((float16)1.0f, z, is_seen);
    detail[at * 3] = select((float16)0.0f, own[0] * per_own - r * per_all, is_seen);
    detail[at * 3 + 1] = select((float16)0.0f, own[1] * per_own - g * per_all, is_seen);
    detail[at * 3 + 2] = select((float16)0.0f, own[2] * per_own - b * per_all, is_seen);
}

/* the wanted light of the bins of a pass
 * detail    (D / 16, N, 3, 16)
 * wanted    (N, D, 3): result
 */
__kernel void add_detail(__global const ushort *place, __global const float *emission, __global const light_t *outgoing,
                         const int pass, const uint count, __global const float *detail, const float amount,
                         __global float *wanted)
{
    uint d = get_global_id(0), i = get_global_id(1);
    if (d >= D_BINS || i >= count) return;
    size_t at = (size_t)i * D_BINS + d;
    int s = place[at] - D_BINS * pass;
    if (s < 0 || s >= D_BINS) return;
    __global const float *more = detail + ((size_t)(s / 16) * count + i) * 3 * 16 + s % 16;
    float3 light = load_light(outgoing, at) - load3(emission, i);
    float3 sharp = light + amount * (float3)(more[0], more[16], more[32]);
    store3(max(sharp, light / (1.0f + amount)), wanted, at);
}

/* how far the reflected light of each element is from what is wanted
 * emission  (N, 3); outgoing, wanted (N, D, 3)
 * misfit    (N, 2): result, squares of that and of what is wanted, summed over bins and channels
 */
__kernel void misfit(__global const float *emission, __global const light_t *outgoing, __global const float *wanted,
                     const uint count, __global float *misfit)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    float3 e = load3(emission, i);
    float apart = 0.0f, all = 0.0f;
    for (size_t at = (size_t)i * D_BINS; at < (size_t)(i + 1) * D_BINS; at++) {
        float3 w = load3(wanted, at), off = load_light(outgoing, at) - e - w;
        apart += dot(off, off);
        all += dot(w, w);
    }
    misfit[2 * i] = apart;
    misfit[2 * i + 1] = all;
}
