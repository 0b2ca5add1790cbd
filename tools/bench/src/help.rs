//! What `--help` says.

use crate::motors::MODELS;

const HEAD: &str = "\
usage: drivetrain-bench [COMMAND] [OPTIONS]

Shows motors on a CAN bus in a window of the terminal, and drives them. Without options the robot is simulated.

commands
  (none)            the window; ? in it lists the keys
  scan              the ids on the bus, with a guess whose they are; with --ask it sends questions
  watch             what the motors report; nothing is sent
  spin              a speed for all motors, or a motion of a mecanum chassis; needs --arm
  tune              gains of the speed loop of each motor, by a relay and a step; needs --arm
  identify          friction, resistance, inertia and delay of each motor by ten seconds of swings, and the gains
                    that follow; changes none; needs --arm
  record            every frame to --output FILE
  replay FILE       what the motors in a recording reported; --output FILE converts it
  get REGISTER      reads a register of the first motor (Damiao, RobStride)
  set REGISTER X    writes it; Damiao keeps it after a loss of supply
  set-id ID         gives the first motor another id (Damiao, RobStride)

the bus
  (none)            a simulated robot; --seed N
  --interface NAME  SocketCAN; bring it up before: sudo ip link set can0 up type can bitrate 1000000
  --serial PORT     a slcan adapter, such as /dev/ttyACM0, at 1 Mbit/s
  --replay FILE     a recording of candump or MCAP, in the window

options
  --motors LIST     model:ids, models m3508 or c620 (at most 6 A here), m2006 or c610 (3 A), gm6020 (10 V) and
                    gm6020-current (1 A, once it is switched on in the motor), others at 30 % of their torque; a list of
                    all models is below. All of them have to be there to be armed, and when one is lost all stop
  --arm             send commands; without it nothing is sent
  --rpm N           speed of every output shaft (default: 0, they hold still); for tune the one about which it swings, for
                    identify the limit (default: 286; of a GM6020 by voltage 134)
  --mecanum X,Y,W   m/s ahead, m/s to the left, rad/s counter-clockwise; needs m3508:1-4 as front right,
                    front left, rear left and rear right
  --geometry R,L,B  radius of the wheels, half of the wheelbase and half of the track in m (default: 0.076,0.2,0.18)
  --amplitude N     of relay and swings, in A, V or Nm (default: half of the limit; of a GM6020 by voltage 0.4, to
                    identify 0.8)
  --hysteresis N    of the relay, in rad/s (default: 0.5; of a GM6020 by voltage 4)
  --turns N         the way of identify to either side (default: 16); a joint between stops needs less
  --seconds S       how long (default: 5; scan, get, set and set-id 2; tune, identify, replay and the window without
                    an end); Ctrl-C, Ctrl-Z and a terminal that is gone end it as well, with zeros
  --log FILE        every frame: MCAP if the name ends in .mcap, otherwise the form of candump -L
  --json            a line of JSON for each report
  --held            the simulator of the window stands, and moves on by the keys . and :

Lift the wheels first, and keep the switch of the battery at hand: nobody sends zeros where this program is killed or halted
by force, the PC hangs, the adapter is pulled out, or the bus takes no frames. Keep the interface's txqueuelen at 10.

exit codes: 0 it is done, 1 it failed or a motor was lost, 2 the arguments make no sense

examples
  drivetrain-bench
  drivetrain-bench --interface can0 --motors m3508:1-4,damiao4310:1:0x11
  drivetrain-bench scan --interface can0 --seconds 2
  drivetrain-bench spin --interface can0 --motors m3508:1 --rpm 30 --arm
  drivetrain-bench tune --motors m3508:1 --arm
  drivetrain-bench record --interface can0 --output drive.mcap --seconds 60
  drivetrain-bench get ControlMode --interface can0 --motors damiao4310:1";

/// Returns the help.
pub(crate) fn text() -> String {
    format!("{HEAD}\n\nmodels              {MODELS}")
}
