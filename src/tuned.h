#pragma once
#include <mpi.h>

#include <string>
#include <vector>

namespace fretwave {

/// A constant that was tuned and not derived: its value here, another by PETSc's option -fw_<name>, read
/// where it is used. PETSc's -help, `fretwave doctor --constants` and `all` list them.
class Tuned {
 public:
  Tuned(char const* name, double value, char const* meaning);
  Tuned(Tuned const&) = delete;
  /// `InputError` where the option is no number above zero.
  operator double() const;
  std::string name() const { return name_; }
  double value() const { return value_; }  ///< without the option
  std::string meaning() const { return meaning_; }
  static std::vector<Tuned const*> const& all();
  /// Lists them where PETSc's -help is given, once. Collective.
  static void help(MPI_Comm);

 private:
  char const *name_, *meaning_;
  double value_;
};

}  // namespace fretwave
