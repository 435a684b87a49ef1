#pragma once
#include "petsc.h"

namespace fretwave {

/// r where A = r B entry by entry, but for the last digits; 0 where it is not. Collective.
double multiple_of(Mat A, Mat B);

}  // namespace fretwave
