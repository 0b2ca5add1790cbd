"""The drivers of others alone, as their examples use them: they know nothing of this board, so what they do checks its model."""
from rows.judge import must, row

# Ten frames came back, and the character after 9 is a colon.
REPORT = b"can :\n"


@row("-", "fresh", "check")
def loop_back(robot):
    """Ten frames go out and come back in silent loop-back, and the report leaves by DMA."""
    robot.run(12_000)
    must(bytes(robot.heard) == REPORT, f"the report is {bytes(robot.heard)}")
    silent = [frame for frame in robot.wire.record if frame.sender == "silent"]
    must(len(silent) == 10 and not robot.sent(), f"{len(silent)} frames in the loop, {len(robot.sent())} on the line")
    must([frame.data[0] for frame in silent] == list(range(10)), "the frames are not those that were sent")
    return {"zero_us": None, "stale": 0, "note": "ten frames come back; the report leaves by DMA"}


@row("-", "fresh", "echo")
def echo(robot):
    """What arrives at the serial port goes by DMA to the program, up to the pause, and back by DMA."""
    robot.run(12_000)
    robot.heard.clear()
    for text in (b"one", b"and twenty bytes more"):
        robot.say(text)
        robot.run(robot.clock.us() + 2 * 90 * len(text) + 1_000)
        must(bytes(robot.heard) == text, f"back came {bytes(robot.heard)}")
        robot.heard.clear()
    return {"zero_us": None, "stale": 0, "note": "what was sent, up to the pause, comes back"}
