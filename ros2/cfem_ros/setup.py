from setuptools import setup

setup(
    name="cfem_ros",
    version="0.1.0",
    packages=["cfem_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/cfem_ros"]),
        ("share/cfem_ros", ["package.xml"]),
        ("share/cfem_ros/launch", ["launch/controller.launch.py"]),
    ],
    install_requires=["setuptools", "cfem"],
    license="Apache-2.0",
    entry_points={"console_scripts": ["controller = cfem_ros.node:main"]},
)
