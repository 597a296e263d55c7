# Sourced by scripts that run stock YARP out of the folder $STOCK.
stock_package=$(echo "$STOCK"/lib/python3*/site-packages/yarp)
stock_libraries="$stock_package/lib:$stock_package/lib/yarp"
# Runs a command with stock's libraries; ours must not see them.
with_stock() {
    PATH="$STOCK/bin:$PATH" LD_LIBRARY_PATH="$stock_libraries" \
        YARP_DATA_DIRS="$stock_package/share/yarp" YARP_FORWARD_LOG_ENABLE=0 "$@"
}
