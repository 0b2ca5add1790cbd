#!/bin/busybox sh
# The first program of the emulated machine: brings up the CAN interfaces, runs the test and powers off. MODULES and
# ONLY come with the kernel's command line. The kernel writes to the first serial port, the test to the second.
export PATH=/bin
bb=/bin/busybox
$bb mount -t devtmpfs none /dev
$bb mount -t proc none /proc
$bb mount -t sysfs none /sys
$bb mkdir -p /dev/pts /tmp && $bb mount -t devpts none /dev/pts
$bb stty -F /dev/ttyS1 -opost
{
    for module in $(echo "$MODULES" | $bb tr , " "); do
        argument=""
        # With an echo of the driver: otherwise frames reach the other sockets past the queue, and none is ever lost.
        [ "$module" != vcan ] || argument=echo=1
        $bb insmod "/modules/$module.ko" $argument || echo "no module $module"
    done
    # By its path: busybox's shell prefers its own `ip`, which knows no CAN.
    /bin/ip link add dev vcan0 type vcan && /bin/ip link set vcan0 up || echo "no vcan0"
    for interface in can0 can1; do
        /bin/ip link set $interface up type can bitrate 1000000 || echo "no $interface"
    done
    PYTHONHOME=$($bb cat /python-home) PYTHONPATH=/opt/masters/python MOTORBRIDGE_TX_GAP_US=0 MOTORBRIDGE_BULK_OP_GAP_MS=0 \
    LC_ALL=C.UTF-8 SHELL=/bin/sh VCAN_RESULTS=/results VCAN_BENCH=/bin/drivetrain-bench VCAN_EXAMPLE=/bin/socketcan \
        vcan --ignored --nocapture --test-threads 1 $ONLY </dev/null
} >/dev/ttyS1 2>&1
$bb poweroff -f
