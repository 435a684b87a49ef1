#pragma once
#include <stdexcept>
#include <string>

namespace fretwave {

/// Bad input: what is wrong, where, measured against expected, and one way to fix it. Becomes
/// fretwave.InputError in Python.
struct InputError : std::runtime_error {
  InputError(std::string what_, std::string measured_ = "", std::string expected_ = "", std::string fix_ = "",
             std::string where_ = "")
      : std::runtime_error(what_),
        measured(std::move(measured_)),
        expected(std::move(expected_)),
        fix(std::move(fix_)),
        where(std::move(where_)) {}
  std::string measured, expected, fix, where;
};

/// A block that cannot be inverted: what was to be solved with it fails (a step), not the run.
struct SingularBlock : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What a rank failed at, known to all of them (`together`). Becomes fretwave.FretwaveError in Python.
struct RankFailure : std::runtime_error {
  RankFailure(std::string what_, std::string where_, std::string fix_)
      : std::runtime_error(what_), where(std::move(where_)), fix(std::move(fix_)) {}
  std::string where, fix;
};

/// Someone wants the work to end. Becomes KeyboardInterrupt in Python.
struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted") {}
};

}  // namespace fretwave
