# SpiD toolkit.  make deps | make | make web | make check | make bench | make demo |
# make install | make clean.  Everything generated goes under build/.

PREFIX  ?= /usr/local
DESTDIR ?=
BUILD   := build$(if $(SANITIZE),/sanitize)
VERSION := 0.1.0

CC  ?= cc
CXX ?= c++
WARN := -Wall -Wextra -Wshadow -Wpointer-arith -Wvla -Wwrite-strings \
        $(if $(CI),-Werror)
CWARN := -Wstrict-prototypes -Wmissing-prototypes
# Contraction is off so that every instruction set rounds as written; kernels
# that want fused multiply-add say so (see TMPL_* below).
OPT ?= -O2 -g
BASE := $(OPT) $(WARN) -I. -I$(BUILD)/gen -MMD -MP -pthread -fopenmp-simd \
        -ffp-contract=off -fno-math-errno -fno-trapping-math \
        -D_GNU_SOURCE -DSPID_VERSION='"$(VERSION)"' \
        -DSPID_DATADIR='"$(PREFIX)/share/spid"'
ifneq ($(SANITIZE),)
BASE += -fsanitize=$(SANITIZE) -fno-omit-frame-pointer -fno-sanitize-recover=all
endif
CFLAGS_ALL   := -std=gnu17 $(CWARN) $(BASE) $(CFLAGS)
CXXFLAGS_ALL := -std=c++17 $(BASE) $(CXXFLAGS)

# ---- libraries: a program that uses nothing of one does not link it --------

comma := ,
HAVE_PKG = $(shell pkg-config --exists $(1) 2>/dev/null && echo 1)
OPENCV_CFLAGS := $(shell pkg-config --cflags opencv4 2>/dev/null)
OIIO_CFLAGS   := $(shell pkg-config --cflags OpenImageIO 2>/dev/null)
JSON_CFLAGS   := $(shell pkg-config --cflags libcjson 2>/dev/null)
MPI := $(call HAVE_PKG,ompi-c)
ifeq ($(MPI),1)
MPI_CFLAGS := -DSPID_MPI $(shell pkg-config --cflags ompi-c)
MPI_LIBS   := $(shell pkg-config --libs ompi-c)
endif
CFLAGS_ALL   += $(JSON_CFLAGS)
CXXFLAGS_ALL += $(JSON_CFLAGS) $(OPENCV_CFLAGS) $(OIIO_CFLAGS)
# Of objdetect only the cascade is taken: the shared library wants six others.
LIBS := -Wl,--as-needed -lcjson -lxxhash -lpng -ljpeg -lexif -llcms2 -lz -ldnnl \
        -l:libopencv_objdetect.a -lopencv_core -lopencv_imgproc -ltinygltf -lzip \
        -lonnx_proto -lprotobuf $(MPI_LIBS) -lgomp -lm
# These bring 250 and 130 others along, so they come with modules
# (formats/module.h).
LIBS_media := -Wl,--as-needed -lOpenImageIO -lOpenImageIO_Util -lopencv_core \
        -lopencv_imgproc -lopencv_videoio -lheif -lwebpdemux -lwebp -lexif \
        -llcms2 -lm
LIBS_video := -Wl,--as-needed -lavformat -lavcodec -lswscale -lswresample \
        -lavutil -lopencv_core -lopencv_imgproc -llcms2 -lm
LIBS_filter := -Wl,--as-needed -lavfilter -lavutil
LIBS_http := -Wl,--as-needed -lmicrohttpd -ljpeg

# ---- sources: a new file is found by where it lies -------------------------

LIB_C   := $(sort $(wildcard lib/*/*.c lib/lab/*/*.c formats/*.c))
LIB_CC  := $(sort $(wildcard formats/*.cc))
TMPL_C  := $(filter %_tmpl.c,$(LIB_C))
PLAIN_C := $(filter-out %_tmpl.c,$(LIB_C))
MAINS    := $(sort $(wildcard cmd/spid.c cmd/spid-*.c cmd/lab/spid-*.c))
PROGRAMS := $(patsubst %.c,$(BUILD)/bin/%,$(notdir $(MAINS)))
# What the programs share; not part of the library.
SHARED  := $(filter-out $(MAINS),$(sort $(wildcard cmd/*.c cmd/lab/*.c)))
UNIT    := $(patsubst tests/%.c,$(BUILD)/tests/%,\
              $(sort $(wildcard tests/unit/*.c)))
GOLDEN_C := $(sort $(wildcard tests/golden/*.c))
# What kernels are held against and only tests need.
TRUTH_O := $(patsubst %.c,$(BUILD)/obj/%.o,$(wildcard tests/reference/*.c))

# x_tmpl.c is compiled once per instruction set; ISA(name) appends the suffix.
# The compiler's machine counts, not this one.
MACHINE := $(shell $(CC) -dumpmachine)
ISAS := baseline
ifneq ($(filter x86_64-%,$(MACHINE)),)
ISAS += avx2 avx512
endif
TMPL_baseline := -DISA_BASELINE
# There the baseline is NEON, which has fused multiply-add.
ifneq ($(filter aarch64-%,$(MACHINE)),)
TMPL_baseline += -ffp-contract=fast
endif
TMPL_avx2     := -DISA_AVX2 -mavx2 -mfma -mf16c -mbmi2 -ffp-contract=fast
TMPL_avx512   := -DISA_AVX512 -mavx512f -mavx512bw -mavx512vl -mavx512dq \
                 -mavx512vnni -mavx512bf16 -mavx2 -mfma -mf16c -mbmi2 \
                 -mprefer-vector-width=512 -ffp-contract=fast

# GCC's debug information of the unrolled kernels would take minutes.
TMPL_DEBUG := $(shell $(CC) -fno-var-tracking-assignments -E -x c /dev/null \
                >/dev/null 2>&1 && echo -fno-var-tracking-assignments)

OBJS := $(PLAIN_C:%.c=$(BUILD)/obj/%.o) $(LIB_CC:%.cc=$(BUILD)/obj/%.o) \
        $(foreach i,$(ISAS),$(TMPL_C:%.c=$(BUILD)/obj/%.$(i).o))
LIB  := $(BUILD)/libspid.a
# The same as a shared library, of which nothing shows but lib/api/spid.h.  An
# executable's objects serve it, but for those that read a variable of another
# library's or of a thread's own (PIC): the linker says which.
SONAME := libspid.so.$(firstword $(subst ., ,$(VERSION)))
SHLIB  := $(BUILD)/$(SONAME)
# The modules, and what they share with the programs.
MODULES  := $(patsubst %,$(BUILD)/lib/spid/%.so,media video filter http)
module_o = $(patsubst %,$(BUILD)/obj/module/%.o,$(basename $(1)))
DOOR     := $(addprefix formats/,door.c door_resize.cc colour.c) \
            lib/base/error.c
MEDIA_O  := $(call module_o,$(sort $(wildcard formats/media/*.c*)) $(DOOR) \
              formats/exif.c formats/video_name.c lib/base/file.c)
VIDEO_O  := $(call module_o,$(sort $(wildcard formats/video/*.c)) $(DOOR) \
              formats/module.c formats/video_name.c lib/base/file.c)
FILTER_O := $(call module_o,$(sort $(wildcard formats/filter/*.c)))
HTTP_O   := $(call module_o,$(sort $(wildcard formats/http/*.c)) \
              lib/base/error.c)
CMD  := $(BUILD)/libcmd.a

HEAD := $(BUILD)/share/spid/head.safetensors

# What a live page runs: the tracker and Phase A in WebAssembly, where there is
# emcc.  oneDNN's, cJSON's and xxHash's headers are the system's, behind emcc's
# own; what needs their code, or learns, is not there to be called.
WASM_C := $(wildcard lib/export/web/wasm/*.c) lib/export/page.c \
          lib/export/page_pack.c $(patsubst %,formats/%.c, \
            arrayview compose compose_tmpl outfile safetensors y4m) \
          $(filter-out lib/nn/conv_onednn.c lib/nn/engine.c,$(wildcard \
            $(patsubst %,lib/%/*.c,base stream head nn net photo track avatar)))
EMCC   := $(shell command -v emcc)
GLUE   := $(if $(EMCC),$(BUILD)/wasm/glue.mjs)
WASM_FLAGS := -std=gnu17 -O2 -msimd128 -ffp-contract=off -fno-math-errno \
        -fno-trapping-math -I. -idirafter /usr/include -D_GNU_SOURCE -MMD -MP \
        -DISA_ONE -DXXH_INLINE_ALL= -DSPID_VERSION='"$(VERSION)"'
WASM_LINK  := -O2 -msimd128 $(foreach s,MODULARIZE=1 EXPORT_ES6=1 \
        ENVIRONMENT=worker ALLOW_MEMORY_GROWTH=1 FORCE_FILESYSTEM=1 \
        TOTAL_STACK=8MB ERROR_ON_UNDEFINED_SYMBOLS=0 \
        WARN_ON_UNDEFINED_SYMBOLS=0 EXPORTED_FUNCTIONS=_malloc \
        EXPORTED_RUNTIME_METHODS=FS$(comma)UTF8ToString,-s $(s))

$(BUILD)/wasm/%_tmpl.o: WASM_FLAGS += -O3 -DISA_BASELINE -DISA_NAME=baseline
$(BUILD)/wasm/%.o: %.c
	@mkdir -p $(@D)
	$(SAY) EMCC $@
	$(EMCC) $(WASM_FLAGS) -c $< -o $@

# Debian's emcc wants Debian's JavaScript modules.
$(BUILD)/wasm/glue.mjs: $(WASM_C:%.c=$(BUILD)/wasm/%.o)
	$(SAY) EMLD $@
	NODE_PATH=/usr/share/nodejs $(EMCC) $^ $(WASM_LINK) -o $@
-include $(shell find $(BUILD)/wasm -name '*.d' 2>/dev/null)

# The page that spid-export --html fills, where there is npm to fetch its
# engine; without it, or without a network, all else is built.
PLAYER   := $(BUILD)/share/spid/player.html
PLAYER_SOURCES := $(sort $(wildcard lib/export/web/*.*))
MODULE_SOURCES := $(sort $(wildcard examples/web/*))

all: $(PROGRAMS) $(MODULES) $(SHLIB) $(HEAD) $(if $(shell command -v npm),$(BUILD)/web/tried)

# The head model is data: spid-head(1) --from says how it was made.
$(HEAD): examples/model/head.safetensors
	@mkdir -p $(@D)
	cp $< $@

$(PLAYER): $(PLAYER_SOURCES) $(MODULE_SOURCES) $(GLUE)
	@mkdir -p $(BUILD)/web $(@D)
	$(SAY) WEB $@
	cp $(PLAYER_SOURCES) $(GLUE) $(GLUE:.mjs=.wasm) $(BUILD)/web
	cd $(BUILD)/web && npm install --silent --no-audit --no-fund \
	  --fetch-retries=1 --fetch-timeout=30000
	cd $(BUILD)/web && node build.mjs player.built live.built \
	  module.built
	mkdir -p $(BUILD)/web-module
	cp examples/web/* $(BUILD)/web-module
	mv $(BUILD)/web/module.built $(BUILD)/web-module/spid-avatar.js
	$(if $(GLUE),mv $(BUILD)/web/live.built $(@D)/player-live.html)
	mv $(BUILD)/web/player.built $@

# Once for each change of the sources, so that a make without a network does
# not wait for one every time.
$(BUILD)/web/tried: $(PLAYER_SOURCES) $(MODULE_SOURCES) $(GLUE)
	@mkdir -p $(@D)
	@$(MAKE) $(PLAYER) || echo "no page for spid-export --html: npm installed \
	  nothing (make web tries again)"
	@touch $@

web: $(PLAYER)

# make V=1 shows the commands themselves.
ifeq ($(V),)
SAY := @printf '%-5s%s\n'
MAKEFLAGS += --silent
else
SAY := @:
endif

$(BUILD)/obj/%.o: %.c
	@mkdir -p $(@D)
	$(SAY) CC $@
	$(CC) $(CFLAGS_ALL) $(MPI_CFLAGS) -c $< -o $@

$(BUILD)/obj/%.o: %.cc
	@mkdir -p $(@D)
	$(SAY) CXX $@
	$(CXX) $(CXXFLAGS_ALL) -c $< -o $@

# A module shows nothing but its table.
MODULE_FLAGS := -fPIC -fvisibility=hidden
$(BUILD)/obj/module/%.o: %.c
	@mkdir -p $(@D)
	$(SAY) CC $@
	$(CC) $(CFLAGS_ALL) $(MODULE_FLAGS) -c $< -o $@

$(BUILD)/obj/module/%.o: %.cc
	@mkdir -p $(@D)
	$(SAY) CXX $@
	$(CXX) $(CXXFLAGS_ALL) $(MODULE_FLAGS) -fvisibility-inlines-hidden -c $< \
	  -o $@

$(BUILD)/lib/spid/media.so: $(MEDIA_O)
$(BUILD)/lib/spid/video.so: $(VIDEO_O)
$(BUILD)/lib/spid/filter.so: $(FILTER_O)
$(BUILD)/lib/spid/http.so: $(HTTP_O)
$(MODULES):
	@mkdir -p $(@D)
	$(SAY) LD $@
	$(CXX) -shared $(BASE) $(LDFLAGS) $^ $(LIBS_$(basename $(@F))) -o $@

# People are shaded by plain loops, a tenth faster so; the bytes are the same.
$(BUILD)/obj/lib/lab/people/%.o: CFLAGS_ALL += $(if $(filter -O2,$(OPT)),-O3)

# A page's style and script as C strings.
$(BUILD)/gen/report_%.inc: lib/lab/report/%
	@mkdir -p $(@D)
	sed 's/[\\"]/\\&/g; s/.*/"&\\n"/' $< > $@
$(BUILD)/obj/lib/lab/report/html.o: $(BUILD)/gen/report_page.css.inc \
                                $(BUILD)/gen/report_page.js.inc

# How synthetic people look and move, likewise.
$(BUILD)/gen/traits.json.inc: examples/config/traits.json
	@mkdir -p $(@D)
	sed 's/[\\"]/\\&/g; s/.*/"&\\n"/' $< > $@
$(BUILD)/obj/lib/lab/people/traits.o: $(BUILD)/gen/traits.json.inc

# Pictures of spid-synth are the same bytes on every processor.
$(BUILD)/obj/lib/lab/people/%: TMPL_LAST := -ffp-contract=off

define tmpl_rule
$(BUILD)/obj/%.$(1).o: %.c
	@mkdir -p $$(@D)
	$$(SAY) CC $$@
	$$(CC) $$(CFLAGS_ALL) -O3 -Wno-psabi $$(TMPL_DEBUG) \
	    $$(TMPL_$(1)) $$(TMPL_LAST) -DISA_NAME=$(1) -c $$< -o $$@
endef
$(foreach i,$(ISAS),$(eval $(call tmpl_rule,$(i))))

$(LIB): $(OBJS)
PIC := $(call module_o,lib/base/parallel.c lib/base/file.c lib/nn/plan.c \
          formats/outfile.c \
          formats/facedetect.cc formats/door_resize.cc)
$(SHLIB): $(BUILD)/obj/lib/api/spid.o $(PIC) $(LIB) lib/api/spid.map
	$(SAY) LD $@
	$(CXX) -shared -Wl,-soname,$(SONAME) -Wl,--version-script=lib/api/spid.map \
	  -Wl,--fatal-warnings $(BASE) $(LDFLAGS) $(filter %.o,$^) $(LIB) $(LIBS) -o $@

$(CMD): $(SHARED:%.c=$(BUILD)/obj/%.o)
$(LIB) $(CMD):
	@rm -f $@
	$(SAY) AR $@
	$(AR) rcs $@ $^

define program_rule
$(BUILD)/bin/$(basename $(notdir $(1))): $(BUILD)/obj/$(1:.c=.o) $(CMD) $(LIB)
	@mkdir -p $$(@D)
	$$(SAY) LD $$@
	$$(CXX) $$(BASE) $$(LDFLAGS) $$< $$(CMD) $$(LIB) $$(LIBS) -o $$@
endef
$(foreach m,$(MAINS),$(eval $(call program_rule,$(m))))

$(BUILD)/tests/unit/%: $(BUILD)/obj/tests/unit/%.o $(TRUTH_O) $(LIB)
	@mkdir -p $(@D)
	$(SAY) LD $@
	$(CXX) $(BASE) $(LDFLAGS) $(filter %.o,$^) $(LIB) $(LIBS) -o $@

$(BUILD)/tests/golden: $(GOLDEN_C:%.c=$(BUILD)/obj/%.o) $(TRUTH_O) $(LIB)
	@mkdir -p $(@D)
	$(SAY) LD $@
	$(CXX) $(BASE) $(LDFLAGS) $(filter %.o,$^) $(LIB) $(LIBS) -o $@

.SECONDARY:
-include $(shell find $(BUILD)/obj -name '*.d' 2>/dev/null)

# ---- what people call ------------------------------------------------------

DEPS := build-essential pkg-config libcjson-dev libxxhash-dev libpng-dev \
        libjpeg62-turbo-dev zlib1g-dev \
        libdnnl-dev libopenimageio-dev libopencv-dev opencv-data \
        libavformat-dev libavcodec-dev libswscale-dev libavfilter-dev \
        libswresample-dev liblcms2-dev libexif-dev libheif-dev libwebp-dev \
        libtinygltf-dev libzip-dev libonnx-dev libprotobuf-dev libmicrohttpd-dev \
        libopenmpi-dev openmpi-bin ffmpeg imagemagick liblcms2-utils \
        libheif-examples libimage-exiftool-perl webp \
        gnuplot-nox bats mandoc python3 python3-numpy

tests: all $(UNIT) $(if $(GOLDEN_C),$(BUILD)/tests/golden)

# make check T="stream dump" runs only the tests with these words in the name.
check: tests
	BUILD=$(BUILD) tests/run $(T)

# What takes minutes and gigabytes: the paper's run at its full size, its tables.
check-long: tests
	BUILD=$(BUILD) SPID_LONG=1 LIMIT=7200 tests/run train-paper paper-tables export-live

# Live driving for half an hour, every program of the pipe killed a hundred
# times, two hundred clips of which ten are killed.
soak: tests
	BUILD=$(BUILD) SPID_SOAK=30 SPID_KILLS=100 SPID_JOBS=200 \
	  SPID_JOB_KILLS=10 LIMIT=7200 tests/run live-soak faults farm

# ThreadSanitizer over the threads of our own: live reading, frames in flight,
# the stream.  libgomp's are not instrumented: tests/tsan.supp.
TSAN := animate_live live-camera animate-pipeline unit/stream base_
tsan:
	$(MAKE) tests SANITIZE=thread
	TSAN_OPTIONS="suppressions=$(CURDIR)/tests/tsan.supp \
	  ignore_noninstrumented_modules=1 allocator_may_return_null=1 \
	  halt_on_error=1 exitcode=66" \
	  BUILD=build/sanitize tests/run $(if $(T),$(T),$(TSAN))

# The kernels on aarch64, cross-built and run by qemu; one line where Debian's
# gcc-aarch64-linux-gnu, qemu-user-static or mmdebstrap is missing.
check-arm:
	tests/check-arm $(T) || [ $$? = 77 ]

bench: all
	$(BUILD)/bin/spid-bench all
	SPID_CPU=avx2 $(BUILD)/bin/spid-bench all

# The libraries' flags are read when make starts: deps first, then a new make.
demo:
	$(MAKE) deps
	$(MAKE) all
	PATH="$(CURDIR)/$(BUILD)/bin:$$PATH" examples/demo.sh $(BUILD)/demo

# Debian packages; nothing is printed or asked when all are there.
deps:
	@[ "$$(dpkg-query -W -f '$${db:Status-Status}\n' $(DEPS) 2>&1 | \
	  grep -cx installed)" = $(words $(DEPS)) ] || { \
	sudo=; [ "$$(id -u)" = 0 ] || sudo=sudo; \
	$$sudo apt-get update -q && $$sudo env DEBIAN_FRONTEND=noninteractive \
	  apt-get install -y -q --no-install-recommends $(DEPS); }
	@! command -v npm >/dev/null || \
	  cmp -s tests/npm/package.json build/npm/package.json || { \
	  mkdir -p build/npm; cp tests/npm/package.json build/npm/; \
	  npm install --silent --no-audit --no-fund --ignore-scripts \
	    --prefix build/npm || { rm -f build/npm/package.json; \
	  echo "make deps: npm installed nothing; tests that compare with it skip"; }; }

# What optional tests want, one by one: what cannot be had is named, and its
# tests skip.
DEPS_TESTS := chromium blender python3-torch python3-scipy python3-onnx \
        imagemagick libimage-exiftool-perl liblcms2-utils libheif-examples \
        bsdutils emscripten
deps-tests: deps
	@sudo=; [ "$$(id -u)" = 0 ] || sudo=sudo; \
	for p in $(DEPS_TESTS) $$(command -v npm >/dev/null || echo npm); do \
	  dpkg-query -W -f '$${db:Status-Status}' $$p 2>/dev/null | \
	    grep -qx installed || $$sudo env DEBIAN_FRONTEND=noninteractive \
	    timeout 900 apt-get install -y -qq --no-install-recommends $$p \
	    >/dev/null || echo "make deps-tests: no $$p: tests that want it skip"; \
	done
	@$(MAKE) deps

# A model from its seeds (hours; see spid-train(1)), from the scans and
# photographs in ASSETS=DIR, and how the shipped one does on people it has
# never seen: with ASSETS of the scans, without plain figures.
model: all
	@[ -n "$(ASSETS)" ] || { echo "make model ASSETS=DIR: spid-synth(1) says \
	  what DIR holds"; exit 64; }
	PATH="$(CURDIR)/$(BUILD)/bin:$$PATH" \
	  examples/train-real.sh "$(ASSETS)" $(BUILD)/train-real

SEED   ?= 77
PEOPLE ?= 40
FRAMES ?= 25
eval-model: all
	PATH="$(CURDIR)/$(BUILD)/bin:$$PATH" ASSETS="$(ASSETS)" \
	  examples/eval-model.sh \
	  $(BUILD)/eval $(SEED) $(PEOPLE) $(FRAMES)

install: all
	install -d "$(DESTDIR)$(PREFIX)/bin" "$(DESTDIR)$(PREFIX)/share/spid" \
	  "$(DESTDIR)$(PREFIX)/share/man/man1" "$(DESTDIR)$(PREFIX)/share/man/man5"
	install $(PROGRAMS) "$(DESTDIR)$(PREFIX)/bin"
	install -D -t "$(DESTDIR)$(PREFIX)/lib/spid" $(MODULES)
	install -m 644 $(wildcard man/*.1) "$(DESTDIR)$(PREFIX)/share/man/man1"
	install -m 644 $(wildcard man/*.5) "$(DESTDIR)$(PREFIX)/share/man/man5"
	install -m 644 $(wildcard man/*.3) -D -t "$(DESTDIR)$(PREFIX)/share/man/man3"
	install -m 644 -D -t "$(DESTDIR)$(PREFIX)/include" lib/api/spid.h
	install -m 644 -D -t "$(DESTDIR)$(PREFIX)/lib" $(LIB)
	strip --strip-debug "$(DESTDIR)$(PREFIX)/lib/$(notdir $(LIB))"
	install -m 644 $(SHLIB) "$(DESTDIR)$(PREFIX)/lib"
	ln -sf $(SONAME) "$(DESTDIR)$(PREFIX)/lib/libspid.so"
	install -d "$(DESTDIR)$(PREFIX)/lib/pkgconfig"
	sed -e 's|@PREFIX@|$(PREFIX)|' -e 's|@VERSION@|$(VERSION)|' \
	  -e 's|@LIBS@|$(LIBS) -lstdc++ -pthread|' lib/api/spid.pc.in \
	  > "$(DESTDIR)$(PREFIX)/lib/pkgconfig/spid.pc"
	for f in $(BUILD)/share/spid/* examples/model/*.safetensors \
	  examples/model/README.md examples/config/traits.json; do \
	  [ ! -e "$$f" ] || install -m 644 "$$f" "$(DESTDIR)$(PREFIX)/share/spid"; \
	done

# libFuzzer over the readers, FUZZ_SECONDS each, or over those of FUZZ="fuzz_ply
# fuzz_glb" alone.  What it finds is kept in tests/fuzz/found and goes through
# its target again in make check.  Needs Debian's clang.
FUZZ_SECONDS ?= 120
FUZZ := $(patsubst tests/fuzz/%.c,%,$(wildcard tests/fuzz/*.c))
FUZZ_FLAGS := -g -O1 -I. -D_GNU_SOURCE -DSPID_VERSION='"$(VERSION)"' \
	  $(JSON_CFLAGS) -DISA_ONE -DISA_BASELINE -DISA_NAME=baseline -MMD -MP \
	  -fno-sanitize-recover=all -fPIC
FUZZ_CC := clang -std=gnu17 $(FUZZ_FLAGS)
FUZZ_CXX := clang++ -std=c++17 $(FUZZ_FLAGS) $(OPENCV_CFLAGS) $(OIIO_CFLAGS)
FUZZ_PART := -fsanitize=fuzzer-no-link,address,undefined
# The readers, and what they need.
FUZZ_READERS := $(wildcard lib/base/*.c lib/stream/*.c formats/record*.c \
	  formats/safetensors*.c formats/compose*.c formats/ply*.c \
	  formats/livelink*.c lib/lab/import/*.c lib/lab/people/wavefront.c \
	  formats/video_name.c $(patsubst %,formats/%.c,arrayview splats npy y4m pnm png \
	  jpeg mark image door colour exif module video outfile) formats/door_resize.cc \
	  formats/glb_read.cc formats/glb_pose.cc)
fuzz_objects = $(patsubst %,$(BUILD)/fuzz/obj/%.o,$(basename $(wildcard $(1))))

fuzz: $(FUZZ:%=$(BUILD)/fuzz/bin/%)
	set -e; mkdir -p tests/fuzz/found; for f in $(FUZZ); do \
	  echo "$$f"; mkdir -p $(BUILD)/fuzz/$$f.corpus tests/fuzz/seed/$$f; \
	  $(BUILD)/fuzz/bin/$$f -max_total_time=$(FUZZ_SECONDS) -timeout=5 \
	    -rss_limit_mb=1024 -artifact_prefix=tests/fuzz/found/$$f- \
	    -print_final_stats=1 -verbosity=0 \
	    $(BUILD)/fuzz/$$f.corpus tests/fuzz/seed/$$f; done

$(BUILD)/fuzz/obj/%.o: %.c
	@mkdir -p $(@D)
	$(FUZZ_CC) $(FUZZ_PART) -c $< -o $@
$(BUILD)/fuzz/obj/%.o: %.cc
	@mkdir -p $(@D)
	$(FUZZ_CXX) $(FUZZ_PART) -c $< -o $@

$(BUILD)/fuzz/readers.a: $(call fuzz_objects,$(FUZZ_READERS))
	rm -f $@
	$(SAY) AR $@
	$(AR) rcs $@ $^

$(BUILD)/fuzz/bin/%: tests/fuzz/%.c $(BUILD)/fuzz/readers.a \
                     $(BUILD)/fuzz/lib/spid/video.so \
                     $(BUILD)/fuzz/lib/spid/media.so
	@mkdir -p $(@D)
	$(SAY) FUZZ $@
	$(FUZZ_CC) -fsanitize=fuzzer,address,undefined $(filter %.c %.a,$^) \
	  -Wl,--as-needed -lxxhash -lcjson -lpng -ljpeg -lexif -llcms2 \
	  -lopencv_core -lopencv_imgproc -lzip -ltinygltf \
	  -fsanitize-link-c++-runtime -lstdc++ -lm -rdynamic -o $@

# The modules, where formats/module.c looks for them first: instrumented too.
$(BUILD)/fuzz/lib/spid/video.so: $(call fuzz_objects,formats/video/*.c \
                          formats/module.c formats/video_name.c \
                          lib/base/file.c $(DOOR))
$(BUILD)/fuzz/lib/spid/media.so: $(call fuzz_objects,formats/media/*.c* \
                          formats/exif.c formats/video_name.c \
                          lib/base/file.c $(DOOR))
$(BUILD)/fuzz/lib/spid/video.so $(BUILD)/fuzz/lib/spid/media.so: \
    $(BUILD)/fuzz/lib/spid/%.so:
	@mkdir -p $(@D)
	$(SAY) FUZZ $@
	$(FUZZ_CXX) $(FUZZ_PART) -shared $^ $(LIBS_$*) -o $@
-include $(shell find $(BUILD)/fuzz -name '*.d' 2>/dev/null)

clean:
	rm -rf build

.PHONY: all web tests check tsan check-long check-arm soak bench model \
        eval-model demo deps deps-tests install fuzz clean
