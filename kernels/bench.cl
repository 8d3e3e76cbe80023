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

/* multiply-adds of sixteen lanes: CHAINS of them side by side, so that none waits for the one before */
#define CHAINS 8
__kernel void multiply_add(
    const uint rounds,
    const float by,
    __global float16 *out)          /* (items) */
{
    size_t i = get_global_id(0);
    float16 a[CHAINS];
    for (int k = 0; k < CHAINS; k++) a[k] = (float)(i + k);
    for (uint n = 0; n < rounds; n++)
        for (int k = 0; k < CHAINS; k++) a[k] = fma(a[k], (float16)(by), (float16)(1.0f));
    float16 sum = 0.0f;
    for (int k = 0; k < CHAINS; k++) sum += a[k];
    out[i] = sum;
}
