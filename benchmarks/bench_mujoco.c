/* MuJoCo on URDF arms, single thread: ns a call for the recursive Newton-Euler algorithm and the composite rigid body
 * algorithm, each with the kinematics that it needs (MuJoCo keeps them as separate stages); and for a step of 1 ms under joint
 * PD towards zero (gains 100 and 20 times the mass matrix' diagonal at zero) by its Euler and RK4 integrators.
 *   ./bench_mujoco robots/panda_arm7.urdf ...      one JSON line per robot and algorithm */
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { STATES = 512, REPEATS = 21, SWEEPS = 20 };

static double cpu(void) { struct timespec t; clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t); return t.tv_sec * 1e9 + t.tv_nsec; }
static int ascending(const void* a, const void* b) { double d = *(const double*)a - *(const double*)b; return (d > 0) - (d < 0); }
static double uniform(double low, double high) { return low + (high - low) * (rand() / (double)RAND_MAX); }

static void rnea(const mjModel* m, mjData* d) {
  mj_kinematics(m, d); mj_comPos(m, d); mj_comVel(m, d); mj_rne(m, d, 1, d->qfrc_inverse);
}
static void crba(const mjModel* m, mjData* d) { mj_kinematics(m, d); mj_comPos(m, d); mj_crb(m, d); }

static void run(const char* robot, const char* algo, void (*call)(const mjModel*, mjData*), const mjModel* m, mjData* d, const double* states) {
  const int n = m->nv;
  double ns[REPEATS];
  for (int r = -1; r < REPEATS; ++r) {  /* the first sweep warms up */
    double start = cpu();
    for (int s = 0; s < SWEEPS; ++s)
      for (int i = 0; i < STATES; ++i) {
        memcpy(d->qpos, states + 3 * n * i, n * sizeof(double));
        memcpy(d->qvel, states + 3 * n * i + n, n * sizeof(double));
        memcpy(d->qacc, states + 3 * n * i + 2 * n, n * sizeof(double));
        call(m, d);
      }
    if (r >= 0) ns[r] = (cpu() - start) / ((double)SWEEPS * STATES);
  }
  qsort(ns, REPEATS, sizeof *ns, ascending);
  printf("{\"job\":\"mujoco\",\"build\":\"wheel\",\"robot\":\"%s\",\"nv\":%d,\"algo\":\"%s\",\"ns\":%.1f,\"min\":%.1f,\"max\":%.1f}\n",
         robot, n, algo, ns[REPEATS / 2], ns[0], ns[REPEATS - 1]);
  fflush(stdout);
}

/* Runs of STEPS steps from a posture near zero. */
static void closed_loop(const char* robot, const char* algo, int integrator, mjModel* m, mjData* d) {
  enum { STEPS = 5000 };
  double ns[REPEATS];
  m->opt.integrator = integrator; m->opt.timestep = 1e-3;
  for (int r = -1; r < REPEATS; ++r) {
    mj_resetData(m, d);
    srand(1);
    for (int j = 0; j < m->nq; ++j) d->qpos[j] = uniform(-0.3, 0.3);
    double start = cpu();
    for (int s = 0; s < STEPS; ++s) {
      for (int j = 0; j < m->nv; ++j) d->qfrc_applied[j] = -m->dof_M0[j] * (100 * d->qpos[j] + 20 * d->qvel[j]);
      mj_step(m, d);
    }
    if (r >= 0) ns[r] = (cpu() - start) / STEPS;
  }
  qsort(ns, REPEATS, sizeof *ns, ascending);
  printf("{\"job\":\"mujoco\",\"build\":\"wheel\",\"robot\":\"%s\",\"nv\":%d,\"algo\":\"%s\",\"ns\":%.1f,\"min\":%.1f,\"max\":%.1f}\n",
         robot, (int)m->nv, algo, ns[REPEATS / 2], ns[0], ns[REPEATS - 1]);
  fflush(stdout);
}

int main(int argc, char** argv) {
  for (int k = 1; k < argc; ++k) {
    char error[500] = "";
    mjModel* m = mj_loadXML(argv[k], 0, error, sizeof error);
    if (!m) { fprintf(stderr, "%s: %s\n", argv[k], error); return 1; }
    m->opt.disableflags |= mjDSBL_CONSTRAINT | mjDSBL_CONTACT;
    mjData* d = mj_makeData(m);
    double* states = malloc(sizeof(double) * 3 * m->nv * STATES);
    srand(1);
    for (int i = 0; i < STATES; ++i)
      for (int j = 0; j < m->nv; ++j) {
        states[3 * m->nv * i + j] = uniform(m->jnt_range[2 * j], m->jnt_range[2 * j + 1]);
        states[3 * m->nv * i + m->nv + j] = uniform(-1, 1);
        states[3 * m->nv * i + 2 * m->nv + j] = uniform(-1, 1);
      }
    const char* slash = strrchr(argv[k], '/');
    char name[200];
    snprintf(name, sizeof name, "%s", slash ? slash + 1 : argv[k]);
    char* dot = strrchr(name, '.');
    if (dot) *dot = 0;
    run(name, "rnea", rnea, m, d, states);
    run(name, "crba", crba, m, d, states);
    for (int j = 0; j < m->nv; ++j) m->dof_damping[j] = m->dof_frictionloss[j] = 0;
    closed_loop(name, "pd_step_euler", mjINT_EULER, m, d);
    closed_loop(name, "pd_step_rk4", mjINT_RK4, m, d);
    free(states); mj_deleteData(d); mj_deleteModel(m);
  }
  return 0;
}
