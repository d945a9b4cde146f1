# `make help` lists what there is. Made for Debian 12; elsewhere install the packages below by your own means.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help build test test-analytics lint check-format demo bench bench-check evaluate evaluate-everybody evaluate-handover soak deny fuzz prove install deb reproduce test-packages test-container test-fleet packages-bench packages-build packages-deb packages-evaluate packages-test

# Debian's packages, in this one place. GStreamer's analytics are in those called bad, from Debian 13 on; in Debian 12 there are none,
# and these would bring 68 others along.
ANALYTICS_PACKAGES := $(shell . /etc/os-release; [ "$${VERSION_ID:-0}" -lt 13 ] || echo libgstreamer-plugins-bad1.0-dev)
BUILD_PACKAGES := ca-certificates curl gcc g++ clang libclang-dev pkg-config git \
	libgstreamer1.0-dev libgstreamer-plugins-base1.0-dev libgstrtspserver-1.0-dev \
	libopencv-core-dev libopencv-imgproc-dev $(ANALYTICS_PACKAGES)
RUN_PACKAGES := gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-good \
	gstreamer1.0-plugins-bad gstreamer1.0-plugins-ugly gstreamer1.0-libav
EVALUATE_PACKAGES := $(RUN_PACKAGES) gstreamer1.0-opencv gnuplot-nox fonts-dejavu-core
BENCH_PACKAGES := $(EVALUATE_PACKAGES) valgrind python3
DEMO_PACKAGES := $(RUN_PACKAGES) python3 gnuplot-nox opencv-doc
TEST_PACKAGES := $(EVALUATE_PACKAGES) ffmpeg chromium mosquitto mosquitto-clients glib-networking nodejs python3 python3-gi python3-venv \
	gir1.2-gst-plugins-base-1.0 e2fsprogs fuse2fs

# rustup puts Rust there; a cargo that is recent enough elsewhere in PATH does as well.
export PATH := $(HOME)/.cargo/bin:$(PATH)
CARGO ?= cargo

# The plugins; the watchdogs, programs of the crates `ptztrack-vapix` and `ptztrack-onvif`; what `pipelines/` are run with; and the program `ptztrack`.
PRODUCT := --package gst-plugin-ptztrack --package gst-plugin-vapix --package gst-plugin-onvifptz --package ptztrack-vapix \
	--package ptztrack-onvif --package pipeline-supervisor --package ptztrack

# What `make demo` shows, and no more: somebody waits for it.
SHOWN := --package gst-plugin-ptztrack --package gst-plugin-vapix --package ptztrack-vapix --package virtual-camera

# Seen when something is built, as it may have been installed just before.
FEATURES = $$(pkg-config --exists gstreamer-analytics-1.0 && echo "--features gst-plugin-ptztrack/analytics")

CODEC ?= mjpeg
DURATION ?= 60
FOOTAGE ?=
ARGS ?=
# A scene or two of every stratum.
SPOT_CHECK := --open-loop --seed 1-2 --scenes 1
WORLD ?= footage
ROOM_TEST ?= 1
SEED ?= 1
INPUTS ?= 10000000
INPUTS_SECONDS ?= 0
RECONNECTS ?= 0
BENCH_SIZE ?= 1280x720
BENCH_SECONDS ?= 16
ROUNDS ?= 5
LIVE_SECONDS ?= 20
RECORDING ?=
TRUTH ?=
# With two people and more.
EVERYBODY_STRATA := crossing,parting,groups
# A package of its own, which shares what is compiled.
BENCHMARKS := --manifest-path tests/benchmarks/Cargo.toml --target-dir target
# The runner must be of the version that the benchmarks are built with.
GUNGRAUN := $(shell sed -n 's/^gungraun = "=\(.*\)"/\1/p' tests/benchmarks/Cargo.toml)

## help: list the targets
help:
	@sed -n 's/^## //p' $(MAKEFILE_LIST)

## build: build the plugins, the watchdog and the program that runs `pipelines/` (release) into target/release
build: packages-build
	$(CARGO) build --release $(PRODUCT) $(FEATURES)

## test: check formatting, lint, build, run all tests
test: packages-test check-format
	@# Clippy's own compiler builds what is tested, so that nothing is compiled twice; it denies warnings as in `make lint`.
	export RUSTC_WORKSPACE_WRAPPER="$$(command -v clippy-driver)" CLIPPY_ARGS="-Dwarnings__CLIPPY_HACKERY__"; \
	$(CARGO) build --workspace --all-targets $(FEATURES); \
	: With cameras on this machine the tests speak plain HTTP, no proxy has a way to these. A critical of GLib ends its test.; \
	env -u http_proxy -u HTTP_PROXY G_DEBUG=fatal-criticals RUST_TEST_THREADS=$${RUST_TEST_THREADS:-4} scripts/with-plugins debug \
		scripts/run-tests $(FEATURES)

## test-analytics: have elements of others read and make GStreamer's analytics metas; needs GStreamer 1.24
test-analytics: packages-test
	$(CARGO) test --manifest-path tests/analytics/Cargo.toml --target-dir target

## lint: check formatting, run clippy and shell syntax checks, warnings denied
lint: packages-build check-format
	$(CARGO) clippy --workspace --all-targets $(FEATURES) -- -D warnings

check-format: packages-build
	$(CARGO) fmt --all --check
	@for script in scripts/* pipelines/*.sh .ci/run; do if head -1 $$script | grep -q bash; then bash -n $$script; fi; done

## demo: follow a person in real footage and leave video, plot and summary in target/demo
##       (CODEC=mjpeg|mpeg4|h264  DURATION=seconds  FOOTAGE=file)
##       WORLD=room: in a made-up room instead (ROOM_TEST=1..72, one of the thesis' tests  SEED=number, another room)
demo: packages-build
	@# What is only needed to run it comes while it is built.
	@trap wait EXIT; scripts/install-packages $(DEMO_PACKAGES) & packages=$$!; \
	$(CARGO) build --profile quick $(SHOWN); \
	wait $$packages
	@case "$(WORLD)" in \
	footage) footage="$(FOOTAGE)"; world=(--footage "$${footage:-$$(scripts/footage)}");; \
	room) world=(--room-test "$(ROOM_TEST)" --seed "$(SEED)");; \
	*) echo "WORLD is footage or room, not $(WORLD)" >&2; exit 2;; \
	esac; \
	scripts/with-plugins quick python3 pipelines/demo/demo.py --camera target/quick/virtual-camera \
		"$${world[@]}" --codec $(CODEC) --duration $(DURATION) --out target/demo

## bench: measure what following costs, on recordings of the room with one person and with eight, and leave tables and plots in
##       target/bench: whole pipelines beside decoding and other elements, in MJPEG and MPEG-4, what they allocate, live pictures as in
##       the thesis' table 5.4, how late commands are, 1 to 16 cameras, and each algorithm by itself from 640x480 to 3840x2160
##       (ROUNDS=5  BENCH_SIZE=1280x720  LIVE_SECONDS=20  FOOTAGE=file, a recording to look at as well)
bench: packages-bench
	$(CARGO) build --release $(PRODUCT) $(FEATURES)
	$(CARGO) build --release $(BENCHMARKS)
	mkdir -p target/bench
	recordings=(); for codec in avi mpeg4; do for world in 1 8 $(if $(FOOTAGE),"$(FOOTAGE)"); do \
		case "$$world" in 1) name=;; 8) name=crowd-;; *) name=footage-;; esac; \
		for camera in still:0 turning:5; do \
			recordings+=("target/bench/$$name$${camera%:*}.$$codec"); \
			target/release/record "$${recordings[-1]}" $(BENCH_SIZE) $(BENCH_SECONDS) "$${camera#*:}" "$$world"; \
		done; \
	done; done; \
	scripts/with-plugins release python3 tests/benchmarks/pipelines.py "$${recordings[@]}" \
		--size $(BENCH_SIZE) --pictures $$(( $(BENCH_SECONDS) * 25 )) --rounds $(ROUNDS) --out target/bench
	scripts/with-plugins release python3 tests/benchmarks/allocations.py target/bench/still.{avi,mpeg4} --out target/bench
	scripts/with-plugins release python3 tests/benchmarks/live.py --programs target/release --seconds $(LIVE_SECONDS) --out target/bench
	$(CARGO) bench $(BENCHMARKS) --bench algorithms --bench elements | tee target/bench/algorithms.txt

## bench-check: count the instructions that each element takes for fixed pictures, and fail where one is more than a tenth off the
##       counts in tests/benchmarks/instructions.csv (ARGS=--accept writes these)
bench-check: packages-bench
	$(CARGO) install --quiet --locked gungraun-runner --version $(GUNGRAUN) --root target/tools
	rm -rf target/gungraun
	CARGO_TARGET_DIR="$(CURDIR)/target" GUNGRAUN_RUNNER="$(CURDIR)/target/tools/bin/gungraun-runner" $(CARGO) bench $(BENCHMARKS) --bench instructions -- --save-summary=json
	python3 tests/benchmarks/check_instructions.py target/gungraun tests/benchmarks/instructions.csv $(ARGS)

## evaluate: show two scenes of every stratum to detector and tracker, in some minutes, and leave a table in target/evaluation
##       (ARGS="--open-loop --seed 1-10": all scenes; ARGS="--compare A B": better, worse or not told apart; ARGS="--test 1-6 --tracker all
##       --seed 1-3": the thesis' tests in closed loop; ARGS=--help lists the options; results are kept, ARGS=--fresh runs all anew;
##       PHOTOS=folder: then the photographs in it, PHOTO_ARGS="--tracker all ...", which leaves its report in target/evaluation/photos)
evaluate: packages-evaluate
	$(CARGO) build --release --package evaluation
	target/release/evaluate $(or $(ARGS),$(SPOT_CHECK))
	$(if $(PHOTOS),target/release/evaluate --photos "$(PHOTOS)" --out target/evaluation/photos $(PHOTO_ARGS))

## evaluate-everybody: score who is who among all who are in view (HOTA, IDF1, MOTA): ours beside SORT, ByteTrack, OC-SORT and BoT-SORT
##       over the same regions, in open-loop scenes with two people and more, or in RECORDING=file with TRUTH=file (MOTChallenge); leaves
##       tracks and the table in target/evaluation/everybody (ARGS="--stratum crossing --seed 1 ...")
evaluate-everybody: packages-evaluate
	@scripts/install-packages python3 python3-venv
	$(CARGO) build --release --package evaluation
	rm -rf target/evaluation/everybody
	if [ -n "$(TRUTH)" ]; then \
		recording="$(RECORDING)"; \
		target/release/evaluate --motchallenge target/evaluation/everybody --still-recording "$${recording:-$$(scripts/footage)}" --truth "$(TRUTH)"; \
	else \
		target/release/evaluate --motchallenge target/evaluation/everybody --open-loop --out target/evaluation/everybody-open-loop \
			$(or $(ARGS),--stratum $(EVERYBODY_STRATA)); \
	fi
	scripts/score-everybody target/evaluation/everybody

## soak: follow with four cameras for DURATION=600 seconds while everything happens to them (SEED=1), or until RECONNECTS=40000
##       connections have ended, and leave a plot and an account in target/soak: every camera at rest, nothing grown, nothing lost
soak: DURATION := 600
soak: packages-test
	$(CARGO) build --workspace --lib --bins
	scripts/with-plugins debug target/debug/soak --duration $(DURATION) --reconnects $(RECONNECTS) --seed $(SEED)

## evaluate-handover: have somebody walk before a fixed camera and one that turns, and somebody else come in, in RUNS=20 rooms, and leave
##       in target/handover/runs.csv how soon the second person is seen and how the map's error fell (ARGS="--seed 1 --others 1")
evaluate-handover: RUNS := 20
evaluate-handover: packages-test
	$(CARGO) build --workspace --lib --bins
	scripts/with-plugins debug target/debug/hand_over --runs $(RUNS) $(ARGS)

## deny: check licences and origin of every dependency, and whether any has a known vulnerability
deny: packages-build
	@$(CARGO) deny --version >/dev/null 2>&1 || $(CARGO) install --locked cargo-deny
	$(CARGO) deny check advisories licenses bans sources

## fuzz: feed INPUTS=10000000 inputs to each parser of what others say, under AddressSanitizer; those of earlier runs count until
##       what reads them changes, and the least that reaches all code is kept in tests/fuzz/kept
##       (SANITIZER=none: four times as fast  INPUTS_SECONDS=number, for each parser at most)
fuzz: packages-build
	$(CARGO) build --workspace --lib
	@scripts/fuzz $(INPUTS) $(INPUTS_SECONDS)

## prove: check what this project promises, hours of it, and leave the results in docs/proven.md (CHECKS="death strangers": these
##       only, scripts/prove --list lists them; DURATION=600 s of soak, INPUTS=10000000 for each parser, INPUTS_SECONDS for each at most)
prove: export DURATION := 600
prove: packages-test
	@$(CARGO) +nightly miri --version >/dev/null 2>&1 || rustup toolchain install nightly --profile minimal --component miri
	@$(CARGO) deny --version >/dev/null 2>&1 || $(CARGO) install --locked cargo-deny
	@scripts/install-packages iproute2 iptables systemd
	$(CARGO) build --workspace --all-targets
	INPUTS=$(INPUTS) INPUTS_SECONDS=$(INPUTS_SECONDS) scripts/prove $(CHECKS)

## install: copy what `make build` has built, the plugins to a GStreamer plugin folder, the watchdog to `libexec` in it
##       (PREFIX=/usr/local; without it, root's go to the system's folder, a user's to their own)
install:
	scripts/install-plugins target/release "$(PREFIX)" "$(DESTDIR)"

## deb: make a Debian package of plugins, watchdog and program for the release that this runs on, in target/deb
##      (RELEASE=bookworm|trixie: for that one, built in a bare root of its own, target/bookworm; as root)
ifdef RELEASE
deb:
	@scripts/install-packages mmdebstrap
	@# Not with this make's arguments, or it makes a root in the root.
	env -u MAKEFLAGS -u RELEASE scripts/in-debian "$(RELEASE)" "target/$(RELEASE)" make deb
	rm -f target/deb/*~$(RELEASE)1_*.deb
	install -D --mode=644 --target-directory=target/deb target/$(RELEASE)/ptztrack/target/deb/*~$(RELEASE)1_*.deb
else
deb: packages-build packages-deb
	@# The date is the package's: crates in C would be compiled anew with each commit.
	env -u SOURCE_DATE_EPOCH $(CARGO) build --release $(PRODUCT) $(FEATURES)
	scripts/make-deb target/release target/deb
endif

## reproduce: build the Debian package twice from nothing, which leaves the same bytes both times
reproduce: packages-build packages-deb
	for time in 1 2; do \
		rm -rf target/reproduced; \
		CARGO_TARGET_DIR="$(CURDIR)/target/reproduced" $(CARGO) build --release $(PRODUCT) $(FEATURES); \
		scripts/make-deb target/reproduced/release "target/deb-$$time"; \
	done
	sha256sum target/deb-1/*.deb target/deb-2/*.deb
	cmp target/deb-1/*.deb target/deb-2/*.deb

## test-packages: make it, check it, and install, use and purge it in a bare Debian, and do test-fleet; as root (RELEASE=bookworm|trixie)
test-packages: deb packages-build test-fleet
	@scripts/install-packages $(RUN_PACKAGES) lintian mmdebstrap python3 systemd
	@# Not built from what is packed: the registry has none of them yet.
	$(CARGO) package --workspace --exclude virtual-camera --exclude end-to-end --exclude evaluation --no-verify --allow-dirty
	release="$(RELEASE)"; scripts/test-packages \
		target/deb/*~$${release:-$$(. /etc/os-release; echo $$VERSION_CODENAME)}1_*.deb target/release/virtual-camera

## test-fleet: check deploy/kubernetes against Kubernetes' schemas, where there is a kubectl, and have ten processes share twenty
##       virtual cameras
test-fleet: packages-build
	@scripts/install-packages $(RUN_PACKAGES) python3 python3-venv
	@# Not installed: that of Debian 12 does not know what deploy/kubernetes asks of it.
	if command -v kubectl >/dev/null; then scripts/test-kubernetes; else echo "Without kubectl, deploy/kubernetes is not checked."; fi
	$(CARGO) build --release $(PRODUCT) $(FEATURES) --package virtual-camera
	scripts/test-fleet target/release

## test-container: build the container of deploy/Containerfile with podman, and follow in it, not as root and on a read-only root;
##       as root (RELEASE=bookworm where this is another)
test-container: deb packages-build
	@scripts/install-packages $(RUN_PACKAGES) curl mmdebstrap podman runc
	$(CARGO) build --release --package virtual-camera
	scripts/test-container target/release/virtual-camera

packages-build:
	@scripts/install-packages $(BUILD_PACKAGES)
	@scripts/install-rust

packages-deb: packages-build
	@scripts/install-packages dpkg-dev
	@$(CARGO) cyclonedx --version >/dev/null 2>&1 || $(CARGO) install --locked cargo-cyclonedx

packages-evaluate: packages-build
	@scripts/install-packages $(EVALUATE_PACKAGES)

packages-bench: packages-build
	@scripts/install-packages $(BENCH_PACKAGES)

packages-test: packages-build
	@scripts/install-packages $(TEST_PACKAGES)
