// Philox4x32-10: a counter-based random number generator (Salmon, Moraes, Dror, Shaw: Parallel random numbers: as easy
// as 1, 2, 3; SC'11). The output is a pure function of counter and key: no state anywhere.
#include "simd_*.cl"

typedef struct { wordv word[4]; } Philox;

INLINE Philox philox4x32_10(Philox counter, uint key0, uint key1) {
    Philox c = counter;
    #pragma unroll
    for (int round = 0; round < 10; ++round) {
        wordv high0, low0, high1, low1;
        multiply_wide(c.word[0], 0xD2511F53u, &high0, &low0);
        multiply_wide(c.word[2], 0xCD9E8D57u, &high1, &low1);
        c.word[0] = high1 ^ c.word[1] ^ key0;
        c.word[1] = low1;
        c.word[2] = high0 ^ c.word[3] ^ key1;
        c.word[3] = low0;
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
    return c;
}
