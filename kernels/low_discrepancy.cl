/* low_discrepancy.cl: points of the unit square that are stratified however many are taken.
 *
 * Owen-scrambled points of Sobol's (0, 2)-sequence by hashing (Burley 2020): every aligned block of 2^m consecutive
 * indices is stratified in both dimensions, so pixels that take neighbouring blocks complete each other (interleaved
 * sampling, Keller and Heidrich 2001).
 */

inline uint reverse_bits(uint x)
{
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

inline uint hash(uint x)
{
    x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; x *= 0x846ca68bu; x ^= x >> 16;
    return x;
}

/* Owen's scrambling: each bit is flipped by a hash of the bits above it.  Laine and Karras 2011, Burley 2020 */
inline uint scramble(uint x, uint seed)
{
    x = reverse_bits(x);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverse_bits(x);
}

/* point `index` of the sequence `seed` in [0, 1)^2 */
inline float2 sobol(uint index, uint seed)
{
    uint s = hash(seed + 1u);
    index = scramble(index, s);
    uint y = 0u;
    uint i = index;
    for (uint v = 1u << 31; i != 0u; i >>= 1, v ^= v >> 1)
        if (i & 1u) y ^= v;
    uint x = scramble(reverse_bits(index), hash(s ^ 0x68bc21ebu));
    y = scramble(y, hash(s ^ 0x02e5be93u));
    return (float2)((float)(x >> 8), (float)(y >> 8)) * 0x1p-24f;
}
