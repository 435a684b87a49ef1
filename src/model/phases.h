#pragma once
#include "model/model.h"

namespace fretwave::model {

/// sum_k A_k e^{-i k theta} as one real matrix. Where all factors are real (`travelling` false): as it is.
/// Otherwise each entry a = ar + i ai becomes [[ar, -ai], [ai, ar]] on (re, im) pairs that stand together: an
/// eigenvalue of the complex matrix comes twice, as x and as i x. Collective.
MatHandle real_form(std::vector<PhasedMap> const& parts, double theta, bool travelling);

/// Terms of one order with their phases.
std::vector<PhasedMap> terms_of(Model const&, int order);

/// B of a contact with all its phases, the own sector's first.
std::vector<PhasedMap> maps_of(Contact const&);

}  // namespace fretwave::model
