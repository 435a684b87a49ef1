#pragma once
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "contact/law.h"

namespace fretwave::contact {

/// What a parameter is to the mechanics, whatever its name: by it other parts of the program find a
/// stiffness, a limit, a load or a gap. A law has at most one of a role (but `none`).
enum class Role {
  none,
  normal_stiffness,
  tangential_stiffness,
  friction_coefficient,
  friction_limit,
  load,
  gap,
  regularisation
};

/// One parameter of a law: the only place of its unit (of a quantity, "force/length"), bound and meaning.
struct Parameter {
  std::string name, unit, doc;
  Role role = Role::none;
  double lower = 0;
  bool strict = false;  ///< value must be above, not at, the bound
  std::optional<double> standard = {};
};

/// The gap, the same in every law that opens.
inline Parameter gap_parameter() {
  return {.name = "gap",
          .unit = "length",
          .doc = "initial gap; negative is an interference",
          .role = Role::gap,
          .lower = -std::numeric_limits<double>::max(),
          .standard = 0.0};
}

/// One value per pair for each parameter name.
using Parameters = std::map<std::string, std::vector<double>>;

struct Entry {
  std::string name, doc;
  int components;
  std::vector<Parameter> parameters;
  std::function<std::unique_ptr<Law>(Parameters const&)> make;
};

/// All laws known by name. A new law is its own file and one line here.
std::span<Entry const> laws();

/// Law by name for the pairs the parameters are given for; InputError for an unknown name or a value out of
/// bounds.
std::unique_ptr<Law> make_law(std::string const& name, Parameters const&);

}  // namespace fretwave::contact
