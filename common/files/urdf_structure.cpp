#include "common/files/urdf_structure.h"

#include <set>

namespace hamel::files {
namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& n : names) out += (out.empty() ? "" : ", ") + n;
  return out;
}

class Checker {
 public:
  Checker(const UrdfStructure& s, const std::string& file) : s_(s), file_(file) {}

  Problems check(const std::string& tip) {
    if (!check_links()) return std::move(found_);
    const std::string root = find_root();
    if (root.empty()) return std::move(found_);
    for (const UrdfJoint& j : s_.joints) children_[j.parent].push_back(&j);
    if (!moves_behind(root)) fail(s_.links.at(root).line, "robot", "no moving joint");
    walk(root, root);
    if (single_ && !tip.empty()) check_tip(tip);
    return std::move(found_);
  }

 private:
  void fail(int line, const std::string& who, const std::string& what) {
    found_.push_back({file_ + ":" + std::to_string(line) + ": " + who, what});
  }

  bool check_links() {
    std::map<std::string, const UrdfJoint*> parent_of;
    for (const UrdfJoint& j : s_.joints) {
      for (const std::string& link : {j.parent, j.child})
        if (!link.empty() && s_.links.count(link) == 0)
          fail(j.line, "joint " + j.name, "link " + link + " does not exist");
      const auto [other, first] = parent_of.emplace(j.child, &j);
      if (!first && !j.child.empty())
        fail(j.line, "link " + j.child,
             "has two parents (joints " + other->second->name + ", " + j.name +
                 "): a loop, not an open chain");
      if (j.parent.empty() || j.child.empty()) return false;  // said where the joint was read
    }
    if (s_.links.empty()) fail(1, "robot", "has no link");
    return found_.empty();
  }

  std::string find_root() {
    std::set<std::string> children;
    for (const UrdfJoint& j : s_.joints) children.insert(j.child);
    std::vector<std::string> roots;
    for (const auto& [name, link] : s_.links)
      if (children.count(name) == 0) roots.push_back(name);
    if (roots.size() == 1) return reaches_all(roots.front()) ? roots.front() : "";
    if (roots.empty())
      fail(1, "robot", "has no root link: its joints form a loop");
    else
      fail(s_.links.at(roots[1]).line, "robot", "has several root links: " + joined(roots));
    return {};
  }

  /// A ring of links beside the tree has no root of its own.
  bool reaches_all(const std::string& root) {
    std::set<std::string> seen{root};
    for (bool grew = true; grew;) {
      grew = false;
      for (const UrdfJoint& j : s_.joints) grew |= seen.count(j.parent) != 0 && seen.insert(j.child).second;
    }
    for (const auto& [name, link] : s_.links)
      if (seen.count(name) == 0) {
        fail(link.line, "link " + name,
             "is not connected to the root " + root + ": a loop, not an open chain");
        return false;
      }
    return true;
  }

  bool moves_behind(const std::string& link) {
    for (const UrdfJoint* j : children_[link])
      if (j->moves || moves_behind(j->child)) return true;
    return false;
  }

  bool heavy(const std::string& link) {
    if (s_.links.at(link).heavy) return true;
    for (const UrdfJoint* j : children_[link])
      if (!j->moves && heavy(j->child)) return true;
    return false;
  }

  /// Goes down from `link`, which is fixed to `carrier`, the last link that moves by its own joint.
  void walk(const std::string& link, const std::string& carrier) {
    carrier_of_[link] = carrier;
    last_ = carrier;
    std::vector<std::string> branches;
    for (const UrdfJoint* j : children_[link])
      if (j->moves || moves_behind(j->child)) branches.push_back(j->name);
    if (branches.size() > 1) {
      single_ = false;
      fail(s_.links.at(link).line, "link " + link,
           "carries several moving branches (joints " + joined(branches) + "): a tree, not an open chain");
    }
    for (const bool moving : {false, true})  // what moves comes last, so that last_ ends at the tip
      for (const UrdfJoint* j : children_[link])
        if ((j->moves || moves_behind(j->child)) == moving) down(*j, carrier);
  }

  void down(const UrdfJoint& j, const std::string& carrier) {
    if (j.moves && !heavy(j.child))
      fail(s_.links.at(j.child).line, "link " + j.child,
           "no inertial: it moves by joint " + j.name + " and nothing fixed to it has mass or inertia");
    walk(j.child, j.moves ? j.child : carrier);
  }

  void check_tip(const std::string& tip) {
    if (s_.links.count(tip) == 0)
      fail(1, "robot", "end effector " + tip + ": no such link");
    else if (carrier_of_[tip] != last_)
      fail(s_.links.at(tip).line, "link " + tip,
           "cannot be the end effector: must be fixed to the last moving link, " + last_);
  }

  const UrdfStructure& s_;
  const std::string& file_;
  std::map<std::string, std::vector<const UrdfJoint*>> children_;
  std::map<std::string, std::string> carrier_of_;
  std::string last_;
  bool single_ = true;
  Problems found_;
};

}  // namespace

Problems check_structure(const UrdfStructure& s, const std::string& file, const std::string& tip) {
  return Checker(s, file).check(tip);
}

}  // namespace hamel::files
