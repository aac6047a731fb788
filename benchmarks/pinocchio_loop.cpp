// The peer of the sweep's kernels: a loop of Pinocchio's functions over given postures.
//
// usage: pinocchio_loop MODEL POSTURES COUNT FRAME NX NY NZ PUSH MOBILITY ANSWERS
//
// MODEL is a model in Pinocchio's text archive; POSTURES has COUNT configurations as float64. The contact normal is
// (NX, NY, NZ) in the world frame, PUSH = (1 + e) v [m/s], MOBILITY = 1 / m of the ball [1/kg]. ANSWERS gets two
// float64 per posture: n^T J M^-1 J^T n [1/kg], and the largest linear impulse in a joint [N s] of a frictionless
// impact. Prints two processor times per posture [us], the shortest of ten: of the impulse alone, and with the joints.
//
// All memory is allocated before the loop. crba in Pinocchio's WORLD convention leaves the joints' Jacobian in `data`,
// from which getFrameJacobian takes the frame's: faster than computeFrameJacobian, which repeats the kinematics.

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <limits>

namespace pin = pinocchio;

static double processor_time() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

int main(int argc, char **argv) {
  if (argc != 11) return 2;
  pin::Model model;
  pin::serialization::loadFromText(model, argv[1]);
  model.gravity.setZero();
  pin::Data data(model);
  const int count = std::atoi(argv[3]);
  const pin::FrameIndex frame = std::atoi(argv[4]);
  const Eigen::Vector3d normal(std::atof(argv[5]), std::atof(argv[6]), std::atof(argv[7]));
  const double push = std::atof(argv[8]), mobility = std::atof(argv[9]);
  Eigen::MatrixXd postures(model.nq, count), answers(2, count);
  std::ifstream(argv[2], std::ios::binary).read(reinterpret_cast<char *>(postures.data()), 8 * postures.size());

  const pin::JointIndex foot = model.frames[frame].parentJoint;
  pin::Data::Matrix6x jacobian = pin::Data::Matrix6x::Zero(6, model.nv);
  Eigen::VectorXd q(model.nq), row(model.nv), jump(model.nv);
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(model.nv);
  Eigen::LLT<Eigen::MatrixXd, Eigen::Upper> cholesky(model.nv);
  std::vector<pin::Force> forces(model.njoints, pin::Force::Zero());

  for (const bool with_joints : {false, true}) {
    double best = std::numeric_limits<double>::infinity();
    for (int round = 0; round < 10; ++round) {
      const double begin = processor_time();
      for (int i = 0; i < count; ++i) {
        q = postures.col(i);
        pin::crba(model, data, q, pin::Convention::WORLD);
        pin::updateFramePlacement(model, data, frame);
        pin::getFrameJacobian(model, data, frame, pin::LOCAL_WORLD_ALIGNED, jacobian);
        row.noalias() = jacobian.topRows<3>().transpose() * normal;
        cholesky.compute(data.M);
        jump = row;
        cholesky.matrixL().solveInPlace(jump);
        const double give = jump.squaredNorm(), impulse = push / (give + mobility);
        answers(0, i) = give;
        answers(1, i) = impulse;
        if (!with_joints) continue;
        cholesky.matrixU().solveInPlace(jump);
        jump *= -impulse;
        const pin::SE3 placement(data.oMi[foot].rotation(), data.oMi[foot].translation() - data.oMf[frame].translation());
        forces[foot] = placement.actInv(pin::Force(-impulse * normal, Eigen::Vector3d::Zero()));
        pin::rnea(model, data, q, still, jump, forces);
        double largest = 0.0;
        for (int k = 1; k < model.njoints; ++k) largest = std::max(largest, data.f[k].linear().squaredNorm());
        answers(1, i) = std::sqrt(largest);
      }
      best = std::min(best, (processor_time() - begin) / count);
    }
    std::printf("%.6f\n", best * 1e6);
  }
  std::ofstream(argv[10], std::ios::binary).write(reinterpret_cast<const char *>(answers.data()), 8 * answers.size());
}
