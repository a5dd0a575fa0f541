#!/bin/sh
# build_rivals.sh VENV OUT: compiles the C++ and C rivals into OUT; existing programs are kept (2 to 4 minutes and 1 to 2 GB
# for each Pinocchio build; PINOCCHIO="native" builds only this one). VENV holds the wheels of
# benchmarks/requirements.txt; Eigen headers: libeigen3-dev, or EIGEN=folder.
#   native  Pinocchio header-only, -O3 -march=native
#   base    the same without -march (SSE2)
#   wheel   against the compiled templates of the wheel, as a C++ user of the wheel would use it
set -eu
venv=$1 out=$2 here=$(cd "$(dirname "$0")" && pwd)
eigen=${EIGEN:-/usr/include/eigen3}
site=$(echo "$venv"/lib/python3*/site-packages)
prefix=$site/cmeel.prefix mujoco=$site/mujoco
[ -d "$prefix" ] || { echo "$venv: no Pinocchio wheel; run: $venv/bin/pip install -r $here/requirements.txt" >&2; exit 1; }
[ -d "$eigen/Eigen" ] || { echo "$eigen: no Eigen headers; install libeigen3-dev or set EIGEN" >&2; exit 1; }
mkdir -p "$out"
"$venv/bin/python" "$here/dump_model.py" "$out"
define="-DNDEBUG -std=c++17 -w -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 \
  -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12"

# Compiles under a temporary name, so that an interrupted build leaves no program.
pinocchio() {
  name=$1; shift
  case " ${PINOCCHIO:-native base wheel} " in *" $name "*) ;; *) return 0 ;; esac
  [ -x "$out/bench_$name" ] && return
  echo "compiling Pinocchio, $name" >&2
  # shellcheck disable=SC2086  # the defines are several words on purpose
  g++ -O3 $define -I"$prefix/include" -I"$eigen" "$here/bench_pinocchio.cpp" -o "$out/bench_$name.part" "$@"
  mv "$out/bench_$name.part" "$out/bench_$name"
}
pinocchio native -march=native
pinocchio base
# The wheel was compiled without -march: Eigen must align to 16 bytes on both sides.
pinocchio wheel -DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION -L"$prefix/lib" -lpinocchio_default "-Wl,-rpath,$prefix/lib"
gcc -O3 -march=native -I"$mujoco/include" "$here/bench_mujoco.c" -o "$out/bench_mujoco" "$mujoco"/libmujoco.so.* \
  "-Wl,-rpath,$mujoco" -lm
