#include "contact/coulomb_2d.h"

namespace fretwave::contact {

Entry coulomb_2d_entry() {
  return coulomb_entry("coulomb_2d",
                       "elastic Coulomb contact in a plane: variable normal load and lift-off, one tangent",
                       2, [](CoulombParameters p) { return std::make_unique<Coulomb2d>(std::move(p)); });
}

}  // namespace fretwave::contact
