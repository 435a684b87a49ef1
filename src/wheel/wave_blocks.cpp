#include "wheel/wave_blocks.h"

#include "tuned.h"

namespace fretwave::wheel {

namespace {

const Tuned shift("wheel_beside", 1e-3,
                  "relative shift of the fundamental's exponent from where its block is singular");

}  // namespace

Exponents WaveBlocks::beside(Exponents e, int fundamental) {
  e.s[fundamental] *= 1 + shift;
  return e;
}

}  // namespace fretwave::wheel
