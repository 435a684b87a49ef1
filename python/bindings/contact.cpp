#include <algorithm>

#include "casters.h"
#include "contact/registry.h"

namespace fretwave::python {

namespace {

/// A law written in Python, for prototypes: calls object._evaluate(u, v) -> (f, df_du, df_dv) with arrays
/// (samples, components, pairs).
class PythonLaw : public contact::Law {
 public:
  PythonLaw(nb::object law, int pairs) : law_(std::move(law)), pairs_(pairs) {
    components_ = nb::cast<int>(law_.attr("components"));
    odd_ = nb::cast<bool>(law_.attr("odd"));
    nb::object normal = law_.attr("normal");
    normal_ = normal.is_none() ? -1 : nb::cast<int>(normal);
    stuck_stiffness_ = nb::cast<double>(law_.attr("stuck_stiffness"));
  }
  int components() const override { return components_; }
  int pairs() const override { return pairs_; }
  bool odd() const override { return odd_; }
  int normal() const override { return normal_; }
  double stuck_stiffness(int, int pair) const override {
    return open_.empty() || !open_[pair] ? stuck_stiffness_ : 0;
  }
  nb::object given() const { return law_; }

  void force(contact::Motion const& motion, double* f, contact::Record& record) const override {
    nb::tuple out = nb::cast<nb::tuple>(asked("_evaluate", motion));
    take(out[0], motion.size(), f);
    record.df_du.resize(motion.size() * motion.components);
    record.df_dv.resize(motion.size() * motion.components);
    take(out[1], record.df_du.size(), record.df_du.data());
    take(out[2], record.df_dv.size(), record.df_dv.data());
  }

  void force_alone(contact::Motion const& motion, double* f, contact::Record&) const override {
    take(asked("_force_alone", motion), motion.size(), f);
  }

  void diagnose(contact::Motion const& motion, double const* f, contact::Diagnosis& out) const override {
    contact::add_work(motion, f, out.work);
    nb::tuple states = nb::cast<nb::tuple>(asked("_states", motion, numpy_copy(f, shape_of(motion))));
    std::vector<double> status(out.status.size()), gap(out.status.size());
    take(states[0], status.size(), status.data());
    take(states[1], gap.size(), gap.data());
    for (size_t k = 0; k < status.size(); ++k) out.status[k] = contact::Status(int(status[k]));
    if (!out.gap.empty()) out.gap = gap;
  }

 protected:
  /// Which pairs are open there, as the law itself says.
  void set_rest(double const* u) override {
    if (normal_ < 0) return;  // nothing opens
    const std::vector<double> still(size_t(components_) * pairs_);
    std::vector<double> f(still.size());
    const contact::Motion motion{
        .samples = 1, .components = components_, .pairs = pairs_, .u = u, .v = still.data(), .step = 1};
    contact::Record record;
    force_alone(motion, f.data(), record);
    const auto found = contact::states(*this, motion, f.data());
    open_.resize(found.status.size());
    for (size_t i = 0; i < open_.size(); ++i)  // not where it just touches
      open_[i] = found.status[i] == contact::Status::open && found.gap[i] > 0;
  }

 private:
  static std::vector<size_t> shape_of(contact::Motion const& motion) {
    return {size_t(motion.samples), size_t(motion.components), size_t(motion.pairs)};
  }
  template <class... More>
  nb::object asked(char const* method, contact::Motion const& motion, More... more) const {
    const auto shape = shape_of(motion);
    return law_.attr(method)(numpy_copy(motion.u, shape), numpy_copy(motion.v, shape), more...);
  }
  static void take(nb::handle from, size_t size, double* to) {
    auto array = nb::cast<nb::ndarray<double const, nb::c_contig, nb::device::cpu>>(from);
    if (array.size() != size) throw nb::value_error("a law in Python returned an array of the wrong size");
    std::copy_n(array.data(), size, to);
  }

  nb::object law_;
  int pairs_, components_, normal_;
  bool odd_;
  double stuck_stiffness_;
  std::vector<char> open_;  ///< at rest; empty where none can be
};

char const* name_of(contact::Role role) {
  using contact::Role;
  switch (role) {
    case Role::none:
      return "none";
    case Role::normal_stiffness:
      return "normal_stiffness";
    case Role::tangential_stiffness:
      return "tangential_stiffness";
    case Role::friction_coefficient:
      return "friction_coefficient";
    case Role::friction_limit:
      return "friction_limit";
    case Role::load:
      return "load";
    case Role::gap:
      return "gap";
    case Role::regularisation:
      return "regularisation";
  }
  return "none";
}

char const* name_of(contact::Limit limit) {
  return limit == contact::Limit::circle ? "circle" : limit == contact::Limit::each ? "each" : "none";
}

using Samples = nb::ndarray<double const, nb::c_contig, nb::device::cpu>;

/// (status, gap), each samples x pairs, for any displacements, velocities and forces samples x components x
/// pairs.
nb::tuple states(contact::Law const& law, Samples u, Samples v, Samples f) {
  if (u.ndim() != 3) throw nb::value_error("samples are no array of samples x components x pairs");
  contact::Motion motion;
  motion.samples = int(u.shape(0)), motion.components = law.components(), motion.pairs = law.pairs();
  for (Samples const* given : {&u, &v, &f})
    if (given->size() != motion.size()) throw nb::value_error("samples that do not fit the law");
  motion.u = u.data(), motion.v = v.data();
  const contact::Diagnosis found = contact::states(law, motion, f.data());
  const std::vector<size_t> shape = {size_t(motion.samples), size_t(motion.pairs)};
  return nb::make_tuple(numpy_bytes(found.status, shape), numpy_copy(found.gap.data(), shape));
}

nb::list law_table() {
  nb::list out;
  for (auto const& entry : contact::laws()) {
    nb::list parameters;
    contact::Parameters one;
    for (auto const& p : entry.parameters) one[p.name] = {1.0};
    for (auto const& p : entry.parameters)
      parameters.append(nb::make_tuple(p.name, p.unit, p.doc, p.lower, p.strict,
                                       p.standard ? nb::object(nb::cast(*p.standard)) : nb::none(),
                                       name_of(p.role)));
    const auto law = entry.make(one);
    out.append(nb::make_tuple(entry.name, entry.doc, entry.components, parameters, law->hereditary(),
                              law->normal() < 0 ? nb::none() : nb::object(nb::cast(law->normal())),
                              law->wears(), name_of(law->limit())));
  }
  return out;
}

}  // namespace

void bind_contact(nb::module_& m) {
  nb::class_<contact::Law>(m, "Law")
      .def_prop_ro("components", &contact::Law::components)
      .def_prop_ro("odd", &contact::Law::odd)
      .def_prop_ro("pairs", &contact::Law::pairs)
      .def_prop_ro("sliders", &contact::Law::sliders)
      .def_prop_ro("in_python",
                   [](contact::Law const& law) {
                     auto const* one = dynamic_cast<PythonLaw const*>(&law);
                     return one ? one->given() : nb::none();
                   })
      .def("stuck_stiffness", &contact::Law::stuck_stiffness)
      .def("rest",
           [](contact::Law& law, std::vector<double> const& u) {
             if (u.size() != size_t(law.components()) * law.pairs())
               throw nb::value_error("displacements that do not fit the law");
             law.rest(u.data());
           })
      .def("place",
           [](contact::Law& law, std::vector<double> const& at) {
             if (at.size() != law.sliders().size()) throw nb::value_error("sliders that do not fit the law");
             law.place(at);
           })
      .def("states", states);
  m.attr("limit_tolerance") = contact::limit_tolerance;
  m.def("law_table", law_table);
  m.def("make_law", [](std::string const& name, contact::Parameters const& p) {
    return std::shared_ptr<contact::Law>(contact::make_law(name, p));
  });
  m.def("python_law", [](nb::object law, int pairs) {
    return std::shared_ptr<contact::Law>(std::make_shared<PythonLaw>(std::move(law), pairs));
  });
}

}  // namespace fretwave::python
