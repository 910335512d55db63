"""What a test says on the topics of a node, and what it hears."""

from ros2 import ros

OK, WARN, ERROR, STALE = range(4)


def point(messages, place, frame="robot", age=0.0):
    """Of (3,) mm."""
    stamp = ros.Node.now - age
    time = messages["builtin_interfaces/msg/Time"](sec=int(stamp), nanosec=round((stamp % 1) * 1e9))
    header = messages["std_msgs/msg/Header"](stamp=time, frame_id=frame)
    x, y, z = (float(one) / 1000 for one in place)
    return messages["geometry_msgs/msg/PointStamped"](
        header=header, point=messages["geometry_msgs/msg/Point"](x=x, y=y, z=z)
    )


def send(run, topic, place, **more):
    run.node.takes[topic][1](point(run.messages, place, **more))


def tick(run):
    """Level and sentence of the diagnostics; a twentieth of a second goes by."""
    ros.Node.now += 0.05
    run.node.timers[0][1]()
    (status,) = run.node.published["diagnostics"][-1].status
    return int.from_bytes(status.level) if isinstance(status.level, bytes) else status.level, status.message


def goal_of(run, share=0.4):
    return run.model.rest_e + run.model.at_displacement(share * run.model.domain.delta_a[1]).delta_e
