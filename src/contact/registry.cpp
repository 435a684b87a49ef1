#include "contact/registry.h"

#include <cmath>

#include "contact/coulomb_2d.h"
#include "contact/coulomb_3d.h"
#include "contact/coulomb_3d_uncoupled.h"
#include "contact/jenkins.h"
#include "contact/regularised_coulomb.h"
#include "contact/springs.h"
#include "error.h"
#include "text.h"

namespace fretwave::contact {

std::span<Entry const> laws() {
  static std::vector<Entry> const entries = {
      regularised_coulomb_entry(),  jenkins_entry(),    coulomb_3d_entry(),
      coulomb_3d_uncoupled_entry(), coulomb_2d_entry(), unilateral_spring_entry(),
      cubic_spring_entry(),
  };
  return entries;
}

namespace {

void check_values(Entry const& entry, Parameters const& values) {
  for (auto const& p : entry.parameters) {
    auto const& given = values.at(p.name);
    for (size_t i = 0; i < given.size(); ++i)
      if (!std::isfinite(given[i]) || given[i] < p.lower || (p.strict && given[i] == p.lower))
        throw InputError(
            "law '" + entry.name + "', pair " + std::to_string(i) + ": '" + p.name + "' is out of bounds",
            short_text(given[i]), (p.strict ? "> " : ">= ") + short_text(p.lower),
            "give a value within the bound");
  }
}

}  // namespace

std::unique_ptr<Law> make_law(std::string const& name, Parameters const& values) {
  std::string known;
  for (auto const& entry : laws()) {
    if (entry.name == name) {
      check_values(entry, values);
      return entry.make(values);
    }
    known += (known.empty() ? "" : ", ") + entry.name;
  }
  throw InputError("unknown contact law", name, known, "choose one of the known laws");
}

}  // namespace fretwave::contact
