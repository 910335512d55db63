# Every kind of model on every robot, the paper's grid against scrambled Halton sampling, and its three meshes: one page,
# whose last table says what each part cost.
ROBOTS := soft-finger diamond trunk
BEYOND := soft-finger diamond
KINDS := spectral spectral-force mlp
METHODS := scrambled-halton grid
ROWS := 36 100 400
SIZES := 7.7 2.95 2.2
STATES-soft-finger := soft-finger/samples-large
# Of the finger, the scene of the measured tables.
SIZE-soft-finger := -large
STATES-diamond := diamond/samples
STATES-trunk := trunk/samples
# Training rows at which every kind is judged, besides all of them.
CURVE-soft-finger := [10,30,50,100]
CURVE-diamond := [30,60,131]
CURVE-trunk := [50,100]
# End of the cables' reach, and a farther one: what lies between is beyond the models' domain.
REACH-soft-finger := 20 26
REACH-diamond := 30 38
S := pipelines/surrogates
MODELS := $(foreach robot,$(ROBOTS),$(KINDS:%=models/surrogates/$(robot)/%))
SAMPLING := $(foreach method,$(METHODS),$(ROWS:%=$(method)/%))
SAMPLED := $(foreach set,$(SAMPLING),models/surrogates/sampling/$(set)/spectral models/surrogates/sampling/$(set)/mlp)
.PHONY: $(MODELS) $(SAMPLED) $(SAMPLING:%=data/surrogates/sampling/%) $(BEYOND:%=data/surrogates/beyond/%) \
  $(ROBOTS:%=states-%) $(SIZES:%=data/surrogates/meshes/%)

surrogates: export OMP_NUM_THREADS := 1
surrogates: .venv/all
	$(MAKE) --no-print-directory -j1 $(ROBOTS:%=states-%) $(BEYOND:%=data/surrogates/beyond/%) \
	  $(SAMPLING:%=data/surrogates/sampling/%) $(SIZES:%=data/surrogates/meshes/%)
	$(MAKE) --no-print-directory -j2 $(MODELS) $(SAMPLED)
	$(CFEM) report $(S)/report.yaml

$(ROBOTS:%=states-%): states-%:
	$(CFEM) mesh pipelines/$*/scene$(SIZE-$*).yaml
	$(CFEM) sample pipelines/$*/sample$(if $(findstring large,$(STATES-$*)),-large).yaml

$(BEYOND:%=data/surrogates/beyond/%): data/surrogates/beyond/%:
	mkdir -p $@
	sed 's/reach: {mm: \[0, $(word 1,$(REACH-$*))\]}/reach: {mm: [0, $(word 2,$(REACH-$*))]}/' \
	  pipelines/$*/scene$(SIZE-$*).yaml > $@/scene.yaml
	$(CFEM) sample $(S)/sample.yaml --set scene=../../$@/scene.yaml --set mesh=../../data/$*/mesh$(SIZE-$*) \
	  --set 'splits={test: {rows: 40, method: random, seed: 7}}' --out $@/samples

$(MODELS): models/surrogates/%:
	$(CFEM) train $(S)/train-$(patsubst %-force,%,$(*F)).yaml --set dataset=../../data/$(STATES-$(*D)) \
	  --set model.form=$(if $(filter %-force,$(*F)),force,displacement) \
	  --set learning_curve=$(CURVE-$(*D)) --out $@

$(SAMPLING:%=data/surrogates/sampling/%): data/surrogates/sampling/%:
	$(CFEM) mesh pipelines/soft-finger-tet4/scene.yaml
	$(CFEM) sample $(S)/sample.yaml --set splits.train.method=$(*D) --set splits.train.rows=$(*F) --out $@

$(SAMPLED): models/surrogates/sampling/%:
	$(CFEM) train $(S)/train-$(*F).yaml --set dataset=../../data/surrogates/sampling/$(*D) --out $@

$(SIZES:%=data/surrogates/meshes/%): data/surrogates/meshes/%:
	$(CFEM) mesh pipelines/soft-finger-tet4/scene.yaml --set mesh.size="$* mm" --out $@/mesh
	$(CFEM) sample $(S)/sample.yaml --set scene=../soft-finger-tet4/scene.yaml --set mesh=../../$@/mesh \
	  --out $@/samples
	$(CFEM) train $(S)/train-spectral.yaml --set dataset=../../$@/samples --set learning_curve=[30] \
	  --out models/surrogates/meshes/$*
	$(CFEM) control $(S)/control.yaml --set mesh=../../$@/mesh --set models.spectral=../../models/surrogates/meshes/$* \
	  --out $@/control
