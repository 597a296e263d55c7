"""What a program is started with that shall end with the suite, or the thread, that starts it."""

# A suite may be killed, or end by a crash of stock's bindings; what it has started must not stay and take the names of
# the next run's.
TIED = ["setpriv", "--pdeathsig", "KILL"]
