# Sourced by scripts that need to know where things are in the folder $STOCK.
stock_package=$(echo "$STOCK"/lib/python3*/site-packages/yarp)
stock_libraries="$stock_package/lib:$stock_package/lib/yarp"
