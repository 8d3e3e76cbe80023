/* bench.cl: what the device can move at most, for bench.py to compare steps with. */

/* out[i] = in[i]: one read and one write of sixteen bytes a work item */
__kernel void copy(
    const uint count,               /* of float4 */
    __global const float4 *in,      /* (count) */
    __global float4 *out)           /* (count) */
{
    size_t i = get_global_id(0);
    if (i >= count)
        return;
    out[i] = in[i];
}
