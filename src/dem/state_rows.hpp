// Between a State, as files and users see it, and the rows that engines work on.
#pragma once
#include <vector>

#include "dem/body/motion.hpp"
#include "dem/engine.hpp"
#include "dem/grain.hpp"
#include "dem/leapfrog.hpp"

namespace moraine::dem {

// Rows of all grains, held ones with the velocity they are held at.
std::vector<GrainRow> grain_rows(const Scene& scene, const State& state);

// kg, the least inertial mass of a grain.
double least_mass(const Scene& scene, const State& s);

// N, the whole force that the leapfrog applies to a grain at the state's step, without gravity.
Vec3d kick(const Scene& scene, const State& s, Index i);

// What begins a stage, after its first forces: velocities of bodies to n - 1/2, the ledger opened.
void start_half_a_step_back(const Scene& scene, const Reaction& reaction, const WaterReaction& water,
                            BodyMotion& bodies);
void half_step_back(const Scene& scene, GrainRow& grain, Material material, const LoadRow& whole);

// What damped contacts remember of their velocities, from a staggered state that has just begun.
void remember_velocities(const Scene& scene, State& s);

// What a contact remembers in this scene, whatever an earlier stage has left: without friction there is no
// spring, without damping no velocity, ...
Spring<double> remembered(const Scene& scene, const ContactParameters& p, Spring<double> spring);

// Room for so many, so that lists do not grow by copies of themselves.
void reserve(State& s, Index grains, std::int64_t with_water_force);
bool touch(const Sides& sides, const GrainRow& a, const GrainRow& b);
void append_grain(State& s, const GrainRow& grain, const LoadRow& load, BodyId part_of);
// Only if they touch; p: of their materials. The state has the materials of its grains.
void append_contact(State& s, const Scene& scene, const ContactParameters& p, const Sides& sides,
                    const GrainRow& a, const GrainRow& b, Index i, Index j, const Spring<double>& spring);
void append_wall_contact(State& s, const Scene& scene, const Plane& plane, const GrainRow& grain, Index i,
                         const Spring<double>& spring);
// Sorts the contacts, stores the bodies, marks the state staggered.
void finish_state(State& s, const BodyMotion& bodies);

}  // namespace moraine::dem
