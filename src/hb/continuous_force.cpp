#include "hb/continuous_force.h"

#include "hb/continuous_contact.h"

namespace fretwave::hb {

std::unique_ptr<ContinuousForce> continuous_force(Harmonics const& h, contact::Law const& law) {
  return std::make_unique<ContinuousContact>(h, law);
}

}  // namespace fretwave::hb
