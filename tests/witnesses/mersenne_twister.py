"""Random numbers of Julia's ``MersenneTwister``, to repeat samples that were published.

The generator is dSFMT-19937 [SaitoMatsumoto2009], seeded by its ``init_by_array`` with one word.
"""

from __future__ import annotations

import numpy as np

BLOCKS, SHIFT, OFFSET = 191, 19, 117
MASKS = 0x000FFAFFFFFFFB3F, 0x000FFDFFFC90FFFD
FIX, CHECK = (0x90014964B32F4329, 0x3B8D12AC548A7C7A), (0x3D84E1AC0DC82880, 1)
WORD, LONG = 2**32 - 1, 2**64 - 1


def seeded(seed: int) -> list[int]:
    """State for a seed: 192 pairs of words of 64 bits, the last pair of which is carried on."""
    size = 4 * (BLOCKS + 1)
    lag = 11
    middle = (size - lag) // 2
    words = [0x8B8B8B8B] * size

    def mixed(i: int, factor: int, *terms: int) -> int:
        x = sum(terms) & WORD
        return (x ^ (x >> 27)) * factor & WORD

    def spread(i: int, one: int, other: int, add: bool) -> None:
        for place, value in (((i + middle) % size, one), ((i + middle + lag) % size, other)):
            words[place] = (words[place] + value) & WORD if add else words[place] ^ value
        words[i] = other

    r = mixed(0, 1664525, words[0] ^ words[middle] ^ words[-1])
    spread(0, r, (r + 1) & WORD, add=True)
    for count in range(size - 1):
        i = (count + 1) % size
        r = mixed(i, 1664525, words[i] ^ words[(i + middle) % size] ^ words[i - 1])
        spread(i, r, (r + i + (seed if count == 0 else 0)) & WORD, add=True)
    for count in range(size):
        i = count % size
        r = mixed(i, 1566083941, words[i], words[(i + middle) % size], words[i - 1])
        spread(i, r, (r - i) & WORD, add=False)
    state = [words[2 * k] | words[2 * k + 1] << 32 for k in range(size // 2)]
    state[: 2 * BLOCKS] = [x & (2**52 - 1) | 0x3FF << 52 for x in state[: 2 * BLOCKS]]
    bits = [(x ^ fix) & check for x, fix, check in zip(state[-2:], FIX, CHECK, strict=True)]
    if (bits[0] ^ bits[1]).bit_count() % 2 == 0:
        state[-1] ^= 1
    return state


def uniform(seed: int, number: int) -> np.ndarray:
    """The first numbers from [0, 1) for a seed."""
    state, found = seeded(seed), []
    while len(found) < number:
        one, two = state[-2:]
        for k in range(0, 2 * BLOCKS, 2):
            far = (k + 2 * OFFSET) % (2 * BLOCKS)
            x, y = state[k], state[k + 1]
            one, two = (
                (x << SHIFT & LONG) ^ two >> 32 ^ (two << 32 & LONG) ^ state[far],
                (y << SHIFT & LONG) ^ one >> 32 ^ (one << 32 & LONG) ^ state[far + 1],
            )
            state[k] = one >> 12 ^ one & MASKS[0] ^ x
            state[k + 1] = two >> 12 ^ two & MASKS[1] ^ y
        state[-2:] = one, two
        found += state[:-2]
    return np.array(found[:number], np.uint64).view(np.float64) - 1.0
