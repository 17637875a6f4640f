"""The site: `make docs` builds it, strictly. What it says of the code is made from the code."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parent))

import ziamath  # draws formulas without LaTeX, with a font of its own
from docutils import nodes
from reference_from_code import write_reference
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

import lathe_chatter

project = 'lathe_chatter'
author = 'the lathe_chatter maintainers'
project_copyright = '2026, the lathe_chatter maintainers'
version = release = lathe_chatter.__version__

extensions = [
    'myst_nb',  # pages in Markdown, and notebooks, which it runs
    'sphinx.ext.autodoc',
    'sphinx.ext.napoleon',  # docstrings in Google's style
    'sphinx_gallery.gen_gallery',  # examples/*.py with their pictures
]
html_math_renderer = 'drawn'
html_theme = 'sphinx_rtd_theme'  # the one of the ROS 2 documentation
html_title = f'lathe_chatter {release}'
html_static_path = ['_static']
html_css_files = ['site.css']
exclude_patterns = ['_build', 'reference/_made', '**/README.*', 'auto_examples/*.ipynb']
exclude_patterns += ['sg_execution_times.rst', 'auto_examples/sg_execution_times.rst']
# The gallery's sorting is a function; and a checkout may lie under a path with a space.
suppress_warnings = ['config.cache', 'sphinx_gallery.space_in_filename']

myst_enable_extensions = ['dollarmath', 'colon_fence']
myst_heading_anchors = 3
nb_execution_mode = 'cache'
nb_execution_timeout = 300
nb_execution_raise_on_error = True

napoleon_use_ivar = True  # attributes once, from the docstring of their class
autodoc_member_order = 'bysource'
autodoc_typehints = 'description'
python_use_unqualified_type_names = True

sphinx_gallery_conf = {
    'examples_dirs': '../examples',
    'gallery_dirs': 'auto_examples',
    'filename_pattern': r'/plot_',
    'ignore_pattern': r'(^|/)(?!plot_)[^/]*\.py$',  # what needs a data set or a file first
    'abort_on_example_error': True,
    'remove_config_comments': True,
    'write_computation_times': False,
    'download_all_examples': False,
}

write_reference(HERE / 'reference' / '_made')


def write_formula(translator: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Write a formula as a drawing in the page, which needs no script or font from elsewhere."""
    source, _, number = node.astext().partition(r'\tag{')
    name = translator.attval(source)
    formula = ziamath.Latex(source.strip())
    drawing = formula.svg().replace('<svg ', f'<svg role="img" aria-label="{name}" ', 1)
    if isinstance(node, nodes.math_block):
        number = number and f'<span class="eqno">({number.partition("}")[0]})</span>'
        translator.body.append(f'<div class="math">{number}{drawing}</div>')
    else:
        below = formula.getyofst()
        translator.body.append(f'<span style="vertical-align: {below:.1f}px">{drawing}</span>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Add what no extension has."""
    ziamath.config.math.fontsize = 17
    app.add_html_math_renderer('drawn', (write_formula, None), (write_formula, None))
