# Every target sets up what it needs on first use; see env/run.
RUN = env/run

.PHONY: demo test test-long bench peers verification gallery notebooks lint shell format

demo:        ## upset the billet and draw it
	$(RUN) python3 demos/billet_upsetting.py

test:        ## the default test suite
	$(RUN) python3 -m pytest -n 2 -q

test-long:   ## the long cases too
	$(RUN) python3 -m pytest -n 2 -q -m "long or not long"

bench:       ## run time against error
	$(RUN) python3 benchmarks/run_all.py

peers:       ## the same jobs by CalculiX, where it is installed; needs ccx and python3 on the host
	python3 benchmarks/peers/run_all.py

verification: ## compare with docs/REFERENCES.md, write docs/VERIFICATION.md
	$(RUN) python3 benchmarks/verification.py

gallery:     ## docs/GALLERY.md from the pictures of the demos; runs those that have none
	$(RUN) python3 docs/make_gallery.py

notebooks:   ## run the notebooks anew, with their outputs, and check what they claim
	$(RUN) python3 notebooks/run_all.py

lint:        ## style and leftovers
	$(RUN) ruff check .

shell:       ## a shell inside the environment
	$(RUN) bash
