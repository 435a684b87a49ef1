#include "tuned.h"

#include <algorithm>

#include "petsc.h"
#include "text.h"

namespace fretwave {

namespace {

std::vector<Tuned const*>& registered() {
  static std::vector<Tuned const*> constants;
  return constants;
}

}  // namespace

Tuned::Tuned(char const* name, double value, char const* meaning, double below)
    : name_(name), meaning_(meaning), value_(value), below_(below) {
  registered().push_back(this);
}

Tuned::operator double() const {
  double value = value_;
  check(PetscOptionsGetReal(nullptr, nullptr, ("-fw_" + name()).c_str(), &value, nullptr));
  if (!(value > 0 && value < below_))
    throw InputError(
        "option fw_" + name() + ": " + meaning_, short_text(value),
        std::isinf(below_) ? "a number above zero" : "a number above zero and below " + short_text(below_),
        "leave it out");
  return value;
}

int Tuned::count() const { return int(std::min(double(*this), 1e8)); }

namespace {

/// PETSc's macros return its error codes.
PetscErrorCode offered(MPI_Comm comm) {
  PetscOptionsBegin(comm, nullptr, "fretwave: constants that were tuned", "fretwave");
  for (Tuned const* constant : registered()) {
    PetscReal value = constant->value();
    const PetscErrorCode code = PetscOptionsReal(
        ("-fw_" + constant->name()).c_str(), constant->meaning().c_str(), "fretwave", value, &value, nullptr);
    if (code) return code;
  }
  PetscOptionsEnd();
  return PetscErrorCode(0);
}

}  // namespace

void Tuned::help(MPI_Comm comm) { check(offered(comm)); }

std::vector<Tuned const*> const& Tuned::all() { return registered(); }

}  // namespace fretwave
