"""Declares the package for pip and for colcon's ament_python build alike."""

from pathlib import Path
from xml.etree import ElementTree as ET

from setuptools import find_packages, setup

NAME = 'lathe_chatter'
SOURCES = Path(__file__).resolve().parent  # also where colcon builds with links to them
CONFIG = sorted(
    folder for folder in [Path('config'), *Path('config').rglob('*')] if folder.is_dir()
)

PACKAGE = ET.parse(SOURCES / 'package.xml').getroot()

setup(
    name=NAME,
    version=PACKAGE.findtext('version'),
    maintainer=PACKAGE.findtext('maintainer'),
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: ['py.typed'],
        f'{NAME}.dataset': ['*.j2'],
        f'{NAME}.paper': ['*.j2'],
        f'{NAME}.page': ['static/*'],
    },
    python_requires='>=3.10,<3.14',
    install_requires=[
        'numpy>=1.26',  # arrays of samples
        'scipy>=1.11',  # eigenvalues and special functions of the stability analysis
        # The inner loop, compiled without a compiler on the machine. compiled.py sets flags that
        # Numba documents nowhere: a newer one is allowed when the tests have passed with it.
        'numba>=0.59,<0.69',
        'matplotlib>=3.6.3',  # the pictures of a run
        'rich>=13',  # tables and progress bars of the command line
        'argcomplete>=2',  # completion of the command line in shells, as ros2 has it
        'jinja2>=3.1',  # the page of the reproduction, from a template
        'pyyaml>=6.0.1',  # scenario files and metadata.yaml
        'rosbags>=0.11',  # reads the runs of any rosbag2 writer, and knows the message types
        'mcap>=1.2.1',  # writes and reads MCAP; those before install a package `tests`, too
        'lz4>=4.0',  # the compression of the chunks of a run
        'zstandard>=0.22',  # that of runs written by others
        # The operator's page. Ordinary, for a node of the package needs them: 7 MB.
        'starlette>=0.40',  # routes, files and sockets
        'uvicorn>=0.35',  # the server
        'websockets>=15',  # its sockets; the first of which a client can be kept from proxies
        'isal>=1.5',  # the CRCs of a run in a quarter of the time that zlib takes
    ],
    # A run in other hands; each is asked for only where it is used.
    extras_require={
        'identify': ['pyuff', 'sdypy-EMA'],  # universal files, and first poles of a tap test
        'export': ['pyarrow', 'h5py', 'pandas', 'xarray'],
        # The forms of a data set, one of which will do; Zarr 3 needs Python 3.11.
        'dataset': ['pyarrow', 'h5py', 'zarr>=3; python_version >= "3.11"'],
        'cluster': ['distributed'],  # Dask: more machines than one
        'gymnasium': ['gymnasium'],  # a lathe to be learnt
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/launch', sorted(str(file) for file in Path('launch').glob('*.py'))),
        # `ros2 run` looks here; pip alone would put the executables only on PATH.
        (f'lib/{NAME}', sorted(str(file) for file in Path('scripts/ros2_run').iterdir())),
        *(
            (
                f'share/{NAME}/{folder}',
                [str(file) for file in sorted(folder.iterdir()) if file.is_file()],
            )
            for folder in CONFIG
        ),
    ],
    zip_safe=True,
    description='A virtual lathe with bearing clearance for ROS 2',
    long_description=(SOURCES / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    keywords='chatter turning lathe delay-differential-equation ros2 digital-twin mcap',
    classifiers=[
        'Development Status :: 4 - Beta',
        'Intended Audience :: Education',
        'Intended Audience :: Manufacturing',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        *(f'Programming Language :: Python :: 3.{minor}' for minor in range(10, 14)),
        'Topic :: Scientific/Engineering :: Physics',
        'Typing :: Typed',
    ],
    entry_points={
        'console_scripts': [
            'lathe = lathe_chatter.nodes.entry_points:lathe',
            'chatter_monitor = lathe_chatter.nodes.entry_points:chatter_monitor',
            'run_recorder = lathe_chatter.nodes.entry_points:run_recorder',
            'chatter_supervisor = lathe_chatter.nodes.entry_points:chatter_supervisor',
            'operator_page = lathe_chatter.nodes.entry_points:operator_page',
            'cell = lathe_chatter.nodes.entry_points:cell',
            'lathe-chatter = lathe_chatter.cli.main:main',
        ],
    },
)
