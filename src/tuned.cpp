#include "tuned.h"

#include "petsc.h"

namespace fretwave {

namespace {

std::vector<Tuned const*>& registered() {
  static std::vector<Tuned const*> constants;
  return constants;
}

}  // namespace

Tuned::Tuned(char const* name, double value, char const* meaning)
    : name_(name), meaning_(meaning), value_(value) {
  registered().push_back(this);
}

Tuned::operator double() const {
  double value = value_;
  check(PetscOptionsGetReal(nullptr, nullptr, ("-fw_" + name()).c_str(), &value, nullptr));
  if (!(value > 0 && std::isfinite(value)))
    throw InputError("option fw_" + name() + ": " + meaning_, std::to_string(value), "a number above zero",
                     "leave it out");
  return value;
}

std::vector<Tuned const*> const& Tuned::all() { return registered(); }

}  // namespace fretwave
