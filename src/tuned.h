#pragma once
#include <mpi.h>

#include <cmath>
#include <string>
#include <vector>

namespace fretwave {

/// A constant that was tuned and not derived: its value here, another by PETSc's option -fw_<name>, read
/// where it is used. PETSc's -help, `fretwave doctor --constants` and `all` list them.
class Tuned {
 public:
  /// It is below a number too, where that is given: a share or a relative residual.
  Tuned(char const* name, double value, char const* meaning, double below = INFINITY);
  Tuned(Tuned const&) = delete;
  /// `InputError` where the option is no number between zero and that bound.
  operator double() const;
  int count() const;  ///< the whole number in it, of a hundred million at the most
  std::string name() const { return name_; }
  double value() const { return value_; }  ///< without the option
  std::string meaning() const { return meaning_; }
  static std::vector<Tuned const*> const& all();
  /// Lists them where PETSc's -help is given, once. Collective.
  static void help(MPI_Comm);

 private:
  char const *name_, *meaning_;
  double value_, below_;
};

}  // namespace fretwave
