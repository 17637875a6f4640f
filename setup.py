"""Declares the package for pip and for colcon's ament_python build alike."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'lathe_chatter'
CONFIG = sorted(
    folder for folder in [Path('config'), *Path('config').rglob('*')] if folder.is_dir()
)

setup(
    name=NAME,
    version='0.1.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={NAME: ['py.typed'], f'{NAME}.paper': ['*.j2']},
    python_requires='>=3.10',
    install_requires=[
        'numpy',  # arrays of samples
        'scipy',  # eigenvalues and special functions of the stability analysis
        'numba',  # the inner loop, compiled without a compiler on the machine
        'matplotlib',  # the pictures of a run
        'rich',  # tables and progress bars of the command line
        'jinja2',  # the page of the reproduction, from a template
        'pyyaml',  # scenario files and metadata.yaml
        'rosbags',  # reads the runs of any rosbag2 writer, and knows the message types
        'mcap',  # writes and reads MCAP
        'lz4',  # the compression of the chunks of a run
        'zstandard',  # that of runs written by others
        'isal',  # the CRCs of a run in a quarter of the time that zlib takes
    ],
    # A run in other hands; each is asked for only where it is used.
    extras_require={
        'identify': ['pyuff', 'sdypy-EMA'],  # universal files, and first poles of a tap test
        'export': ['pyarrow', 'h5py', 'pandas', 'xarray'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
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
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'lathe = lathe_chatter.nodes.lathe_node:main',
            'chatter_monitor = lathe_chatter.nodes.monitor_node:main',
            'run_recorder = lathe_chatter.nodes.recorder_node:main',
            'cell = lathe_chatter.nodes.cell:main',
            'lathe-chatter = lathe_chatter.cli.main:main',
        ],
    },
)
