#include "hb/continuous_force.h"

#include "hb/circular_contact.h"
#include "hb/continuous_contact.h"
#include "hb/velocity_force.h"

namespace fretwave::hb {

std::unique_ptr<ContinuousForce> continuous_force(Harmonics const& h, contact::Law const& law) {
  switch (law.integration()) {
    case contact::Integration::pieces:
      return std::make_unique<ContinuousContact>(h, law);
    case contact::Integration::circle:
      return std::make_unique<CircularContact>(h, law);
    case contact::Integration::panels:
      return std::make_unique<VelocityForce>(h, law);
    case contact::Integration::samples:
      break;
  }
  return nullptr;
}

}  // namespace fretwave::hb
