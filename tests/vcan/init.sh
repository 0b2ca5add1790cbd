#!/bin/busybox sh
# The first and only program of a user-mode Linux that shares the host's files: brings up vcan0, runs the test and halts.
# RESULTS, TEST and VCAN_EXAMPLE come with the kernel's command line.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
bb=/bin/busybox
$bb mount -t proc proc /proc
$bb mount -t sysfs sysfs /sys
# Not below /tmp: the checkout may stand there.
$bb mount -t hostfs none /mnt -o "$RESULTS"
modules=$($bb ls -d /usr/lib/uml/modules/*/kernel | $bb tail -n 1)
{
    for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev net/sched/sch_netem net/sched/sch_plug; do
        $bb insmod "$modules/$module.ko" || echo "no module $module"
    done
    # With an echo of its own: otherwise frames reach the other sockets past the queue, and none is ever lost.
    $bb insmod "$modules/drivers/net/can/vcan.ko" echo=1 || echo "no module vcan"
    ip link add dev vcan0 type vcan && ip link set vcan0 up \
        && VCAN_RESULTS=/mnt "$TEST" --ignored --nocapture --test-threads 1
    echo $? >/mnt/exit
} >/mnt/output 2>&1
$bb sync
$bb halt -f
