#include "tuned.h"

#include "petsc.h"
#include "text.h"

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
    throw InputError("option fw_" + name() + ": " + meaning_, short_text(value), "a number above zero",
                     "leave it out");
  return value;
}

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
