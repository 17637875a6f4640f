# A cell in a container:   docker build -t lathe_chatter . && docker run --rm -it --net host lathe_chatter
FROM ros:jazzy-ros-base
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-pip python3-colcon-common-extensions \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /ws
COPY . src/lathe_chatter
RUN . /opt/ros/jazzy/setup.sh \
    && rosdep update \
    && apt-get update \
    && PIP_BREAK_SYSTEM_PACKAGES=1 rosdep install --from-paths src --ignore-src -y \
    && rm -rf /var/lib/apt/lists/* \
    && colcon build --packages-select lathe_chatter
ENTRYPOINT ["/bin/bash", "-c", ". /ws/install/setup.bash && exec ros2 run lathe_chatter \"$@\"", "--"]
CMD ["cell"]
