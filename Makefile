# The five commands one needs. In a virtual environment: make install, then the others.
.PHONY: install lint test docs ci

install:  ## everything for development
	pip install -e '.[test,dev]'

lint:  ## style and types
	ruff check .
	ruff format --check .
	mypy

test:  ## the whole suite; `make test only=tests/unit/core` for a part
	pytest $(only)

docs:  ## generated reference, then the pages in site/
	python docs/generate_reference.py
	mkdocs build --strict

ci:  ## what has to hold before anything lands, in an environment of its own
	.ci/run
