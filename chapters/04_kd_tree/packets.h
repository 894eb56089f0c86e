#pragma once
// Packets: rays that go through the tree together (Wald et al. 2001). A node is read once for all of them,
// and all that ask for neither child are idle for a while. On the CPU the lanes of a vector are a packet; in
// CUDA the threads of a warp (packets_warp.h). No ray needs the order of another's cells: which child goes
// first decides only how soon a hit cuts the rest short, so rays of any directions may travel together.

#include "chapters/04_kd_tree/kd_tree.h"

namespace trilha {

constexpr int kd_packet_lanes = 8;

/// The answers of n rays in the CPU's memory, lanes beside each other in a packet. Exists for Watertight.
template <Query query, class Test>
void trace_kd_packets(const KdTreeView& tree, const Triangles<Test, float>& triangles, const Ray* rays,
                      QueryAnswer<query, float>* answers, std::size_t n);

}  // namespace trilha
