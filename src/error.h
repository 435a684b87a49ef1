#pragma once
#include <stdexcept>
#include <string>

namespace fretwave {

/// Bad input: what is wrong, where, measured against expected, and one way to fix it. Becomes
/// fretwave.InputError in Python.
struct InputError : std::runtime_error {
  InputError(std::string what_, std::string measured_ = "", std::string expected_ = "", std::string fix_ = "")
      : std::runtime_error(what_),
        measured(std::move(measured_)),
        expected(std::move(expected_)),
        fix(std::move(fix_)) {}
  std::string measured, expected, fix;
};

}  // namespace fretwave
